"""A fleet on a fake process: one vehicle by its takeoff server, one by the driver."""

import pytest
from fake_vehicles import Driven, Stack

from crazyflie_mission_api import Bounds, Fleet, MissionError, plan
from crazyflie_mission_api import fleet as fleet_module
from crazyflie_utils.testing import FakeProcess

NAMES = ["cf1", "cf2"]


class FakeClock:
    """Time that passes when somebody waits."""

    def __init__(self, handle, has_ended):
        self._process = handle._process

    def time(self):
        return self._process.clock.time()

    def wait_until(self, condition, deadline):
        while not (done := condition()) and self.time() < deadline:
            self._process.advance(0.05)
        return done


@pytest.fixture
def process(monkeypatch):
    """Return a process in which fleets find vehicles."""
    monkeypatch.setattr(fleet_module, "RosClock", FakeClock)
    monkeypatch.setattr(fleet_module, "topic_types", lambda handle: {})
    fake = FakeProcess()
    # A FakeProcess has started.
    monkeypatch.setattr(fake, "start", lambda: fake.advance(0.1))
    return fake


@pytest.fixture
def stack(process):
    return Stack(process, "cf1", (0.0, 0.0, 0.0))


@pytest.fixture
def driven(process):
    return Driven(process, "cf2", (1.0, 0.0, 0.0))


@pytest.fixture
def fleet(process, stack, driven):
    return Fleet(NAMES, Bounds((-2, -2, 0), (2, 2, 2)), process=process, limit=0.5)


def test_one_script_for_both(fleet, stack, driven):
    def mission(team):
        team.takeoff(0.8)
        team.go_to({"cf1": (0.0, 1.0, 1.0), "cf2": (1.0, 1.0, 1.5)})
        path = plan([(0, 0, 1), (0.2, 0, 1), (0.2, 0.2, 1)])
        team.follow(path, relative=True)

    with fleet:
        fleet.fly(mission)
        assert stack.position == pytest.approx([0.2, 1.2, 1.0], abs=1e-4)
        assert driven.position == pytest.approx([1.2, 1.2, 1.5], abs=1e-4)
        assert fleet.flying == NAMES
    assert fleet.flying == []
    assert stack.position[2] == driven.position[2] == 0.0
    assert driven.called() == [
        "update_params",
        "update_params",
        "takeoff",
        "go_to",
        "upload_trajectory",
        "start_trajectory",
        "land",
        "stop",
    ]


@pytest.mark.parametrize("frame", [None, "world"])
def test_headings_are_kept(process, stack, frame):
    driven = Driven(process, "cf2", (1.0, 0.0, 0.0), frame)
    # The controller of the other one keeps the heading 0, whatever it is.
    driven.yaw, stack.yaw = 2.0, 0.3
    fleet = Fleet(NAMES, process=process, limit=0.5)
    with fleet:
        fleet.takeoff(1.0)
        fleet.go_to((0.0, 0.5, 0.0), relative=True)
        fleet.formation([(1.0, 0.0, 1.0), (0.0, 0.0, 1.0)])
        fleet["cf2"].go_to((1.0, 0.0, 1.0), yaw=0.5, relative=False)
        fleet["cf2"].go_to((0.0, 0.0, 0.1), yaw=0.5, relative=True)
    yaws = [request.yaw for name, request in driven.requests if name == "go_to"]
    assert yaws == pytest.approx([2.0, 2.0, 0.5, 1.0])


def test_a_trajectory_is_streamed_if_wanted(fleet, driven):
    with fleet:
        fleet["cf2"].takeoff(1.0)
        fleet["cf2"].follow(plan([(1, 0, 1), (1, 1, 1)]), stream=True)
        assert "upload_trajectory" not in driven.called()
        assert len(driven.setpoints) > 100
        assert max(setpoint.twist.linear.y for setpoint in driven.setpoints) > 0.4
        # The firmware would stop the motors after the last setpoint.
        fleet.wait(0.2)
        assert driven.called()[-1] == "go_to"
        last = driven.setpoints[-1].twist.linear
        assert (last.x, last.y, last.z) == (0.0, 0.0, 0.0)
        assert driven.position == pytest.approx([1.0, 1.0, 1.0])


def test_the_end_of_a_stream_that_fails_ends_the_mission_and_lands(fleet, driven):
    text = "^cf2: the trajectory has ended, and go_to has failed: no reply; setpoints go on"
    with pytest.raises(MissionError, match=text), fleet:
        fleet["cf2"].takeoff(1.0)
        driven.refusals["go_to"] = "no reply"
        fleet["cf2"].follow(plan([(1, 0, 1), (1, 1, 1)]), stream=True)
        fleet.wait(1.0)
    assert driven.called()[-3:] == ["go_to", "land", "stop"]


def test_a_trajectory_that_is_too_long_for_a_memory_is_refused(fleet):
    with fleet:
        fleet["cf2"].takeoff(1.0)
        long = plan([(1, 0.1 * (k % 2), 1) for k in range(33)])
        with pytest.raises(MissionError, match="cf2: upload: the trajectory has 32 pieces; expect"):
            fleet["cf2"].follow(long)


def test_a_vehicle_that_is_in_trouble_ends_the_mission(fleet, stack, driven):
    with pytest.raises(MissionError, match="cf2: lost: nothing is heard"), fleet:
        fleet.takeoff(0.8)
        driven.tell("lost: nothing is heard")
        fleet.wait(10.0)
    assert stack.position[2] == 0.0


def test_a_landing_that_nobody_here_has_wanted_is_noticed(fleet, stack):
    with pytest.raises(MissionError, match="cf1: it does not fly any more"), fleet:
        fleet.takeoff(0.8)
        stack.be("descending")
        fleet.wait(10.0)


def test_who_refuses_to_take_off_is_named_and_the_others_land(fleet, stack, driven):
    stack.refusal = "the battery is low"
    with pytest.raises(MissionError, match="cf1: takeoff: the battery is low"), fleet:
        fleet.takeoff(0.8)
    assert "land" in driven.called()
    assert fleet.flying == []


def test_who_does_not_arrive_is_named(process, stack, driven):
    fleet = Fleet(NAMES, process=process, limit=0.5, patience=1.0)
    driven._on_setpoint = None
    text = r"cf2 is 1.00 m from \(1.00, 1.00, 1.00\): waited 1 s longer than planned; expected 0.15"
    with pytest.raises(MissionError, match=text), fleet:
        fleet["cf2"].takeoff(1.0)
        fleet["cf2"].go_to((1, 1, 1), wait=False)
        driven.position = [1.0, 0.0, 1.0]
        fleet.arrive()


@pytest.mark.parametrize("frame", [None, "world"])
def test_who_is_not_tracked_any_more_does_not_arrive(process, stack, frame):
    driven = Driven(process, "cf2", (1.0, 0.0, 0.0), frame)
    fleet = Fleet(NAMES, process=process, limit=0.5)
    with pytest.raises(MissionError, match="^cf2: nobody says where it is"), fleet:
        fleet.takeoff(1.0)
        fleet["cf2"].go_to((1, 0.5, 1), wait=False)
        # It was at its goal when it was seen last.
        fleet.wait(0.2)
        driven.is_tracked = False
        fleet.arrive()
    # That it has landed is known by its supervisor.
    assert driven.called()[-2:] == ["land", "stop"]
    assert fleet.flying == []


def test_a_landing_that_nobody_sees_is_told_by_the_supervisor(fleet, driven):
    with pytest.raises(MissionError, match="cf2: land: not on the ground 15 s after"), fleet:
        fleet.takeoff(1.0)
        driven.is_tracked = False
        driven.tell = lambda status: None
    assert driven.called()[-1] == "land"


def test_the_fixed_frame_is_the_drivers(process):
    process.transport.parameters["/this_process/frames/fixed"] = "hall"
    Driven(process, "cf2", (1.0, 0.0, 0.0), "hall")
    fleet = Fleet(["cf2"], process=process, limit=0.5)
    assert fleet.position("cf2") == (1.0, 0.0, 0.0)


def test_vehicles_behind_the_driver_do_not_begin_at_the_same_moment(process):
    for number in (1, 2):
        Driven(process, f"cf{number}", (number - 1.0, 0.0, 0.0))
    fleet = Fleet(NAMES, separation=0.95, process=process, limit=0.5)

    def mission(team):
        team.takeoff(1.0)
        team.go_to((1.0, 0.0, 0.0), relative=True)

    text = "expected at least 0.95 m; that is if cf2 begins 0.15 s after the others"
    with pytest.raises(MissionError, match=text):
        fleet.rehearse(mission)
    with pytest.raises(MissionError, match=text), fleet:
        mission(fleet)


def test_a_fence_counts(process, stack, driven):
    for side, value in (("min", -0.5), ("max", 0.5)):
        for axis in "xyz":
            process.transport.parameters[f"/cf1/geofence/box/{side}/{axis}"] = value * 3
    fleet = Fleet(NAMES, process=process, limit=0.5)
    with fleet:
        fleet.takeoff(1.0)
        with pytest.raises(MissionError, match="y is 1.8 m; expected -1.5 to 1.5 m"):
            fleet["cf1"].go_to((0.0, 1.8, 1.0))
        fleet["cf2"].go_to((1.0, 1.8, 1.0))


def test_the_buffers_of_the_fleet_process_count(process, stack, driven):
    process.transport.parameters |= {"/cf1/buffer": 0.3, "/cf2/buffer": 0.35}
    fleet = Fleet(NAMES, process=process, limit=0.5)
    with fleet:
        fleet.takeoff(1.0)
        with pytest.raises(
            MissionError, match=r"at least 0.715 m \(the mission's separation is 0.3"
        ):
            fleet["cf1"].go_to((0.4, 0.0, 1.0))
        fleet["cf1"].go_to((0.2, 0.0, 1.0), duration=6.0)


def test_the_buffers_of_a_fleet_file_count(process, stack, driven, tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(
        "robots:\n  cf1: {initial_position: [0, 0, 0]}\n  cf2: {initial_position: [1, 0, 0]}\n"
        "all: {buffer: 0.4}\n"
    )
    fleet = Fleet(path, process=process, limit=0.5)
    assert fleet.rules.buffers == {"cf1": 0.4, "cf2": 0.4}


def test_names_of_a_fleet_file(process, stack, driven, tmp_path):
    path = tmp_path / "two.yaml"
    robots = "robots:\n  cf1: {initial_position: [0, 0, 0]}\n  cf2: {initial_position: [1, 0, 0]}\n"
    path.write_text(robots)
    assert Fleet(path, process=process, limit=0.5).names == NAMES
    path.write_text(robots + "  cf3: {initial_position: [1, 0]}\n")
    with pytest.raises(MissionError, match=r"two.yaml:4"):
        Fleet(str(path), process=process, limit=0.5)


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (
            ["cf9"],
            "no takeoff and land, and no go_to, below /cf9 after 0.1 s; takeoff is offered",
        ),
        ([], r"the vehicles are \[\]; expected names"),
        (["cf1", "cf1"], "there are two vehicles 'cf1'"),
        ([1], r"the vehicles are \[1\]"),
    ],
)
def test_names_that_make_no_sense(process, stack, driven, names, text):
    with pytest.raises(MissionError, match=text):
        Fleet(names, process=process, limit=0.1)
