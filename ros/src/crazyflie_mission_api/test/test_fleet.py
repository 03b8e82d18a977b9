"""A fleet on a fake process: one vehicle by its takeoff server, one by the driver."""

import math

import pytest
from fake_fleet import fake_process
from fake_vehicles import ControllerVehicle, DriverVehicle
from geometry_msgs.msg import Point, Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import ColorRGBA, Header, String
from tf2_msgs.msg import TFMessage

from crazyflie_driver.srv import StartTrajectory, StartTrajectoryResponse
from crazyflie_mission_api import Bounds, Fleet, MissionError, plan
from crazyflie_mission_api.ros_vehicle import flown_vehicles

NAMES = ["cf1", "cf2"]


@pytest.fixture
def process(monkeypatch):
    """Return a process in which fleets find vehicles."""
    return fake_process(monkeypatch)


@pytest.fixture
def controlled(process):
    return ControllerVehicle(process, "cf1", (0.0, 0.0, 0.0))


@pytest.fixture
def driven(process):
    return DriverVehicle(process, "cf2", (1.0, 0.0, 0.0))


@pytest.fixture
def fleet(process, controlled, driven):
    return Fleet(NAMES, Bounds((-2, -2, 0), (2, 2, 2)), process=process, startup_timeout=0.5)


def test_one_script_for_both(fleet, controlled, driven):
    def mission(group):
        group.takeoff(0.8)
        group.go_to({"cf1": (0.0, 1.0, 1.0), "cf2": (1.0, 1.0, 1.5)})
        path = plan([(0, 0, 1), (0.2, 0, 1), (0.2, 0.2, 1)])
        group.follow(path, relative=True)

    with fleet:
        fleet.fly(mission)
        assert controlled.position == pytest.approx([0.2, 1.2, 1.0], abs=1e-4)
        assert driven.position == pytest.approx([1.2, 1.2, 1.5], abs=1e-4)
        assert fleet.flying == NAMES
    assert fleet.flying == []
    assert controlled.position[2] == driven.position[2] == 0.0
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


def test_colors_are_those_of_vehicles_with_a_driver(fleet, driven):
    """The other vehicle, of a simulator, has no lamps."""
    with fleet:
        fleet.set_led_color(1.0, 0.5, 0.0)
        assert driven.requests[-1][1].color == ColorRGBA(1.0, 0.5, 0.0, 0.0)
        driven.refusals["set_led_color"] = "cf2 carries no lamps"
        with pytest.raises(MissionError, match="cf2: set_led_color: .*cf2 carries no lamps"):
            fleet["cf2"].set_led_color(0.0, 0.0, 0.0)


@pytest.mark.parametrize("in_flight", ["/in_flightHY4", "aloft"])
def test_a_vehicle_whose_in_flight_has_another_name(process, in_flight):
    vehicle = ControllerVehicle(process, "cf1", (0.0, 0.0, 0.0), in_flight)
    with Fleet(["cf1"], process=process, startup_timeout=0.5) as fleet:
        fleet.takeoff(1.0)
        vehicle.be("descending")
        with pytest.raises(MissionError, match="cf1: it does not fly any more: descending"):
            fleet.wait(1.0)
        fleet.land()
        assert fleet.flying == []


def test_a_trajectory_is_left_before_the_next_one_is_uploaded(fleet, driven):
    """The firmware holds the end of a trajectory as long as it is in its memory."""
    path = plan([(0, 0, 1), (0.2, 0, 1)])
    with fleet:
        fleet["cf2"].takeoff(1.0)
        for _ in range(2):
            fleet["cf2"].follow(path, relative=True)
        second = ["upload_trajectory", "start_trajectory"]
        assert driven.called()[-5:] == [*second, "go_to", *second]
        hold = driven.requests[-3][1]
        assert (hold.relative, hold.goal, hold.yaw) == (True, Point(), 0.0)
        assert driven.position == pytest.approx([1.4, 0.0, 1.0])


@pytest.mark.parametrize("frame", [None, "world"])
def test_headings_are_kept(process, controlled, frame):
    driven = DriverVehicle(process, "cf2", (1.0, 0.0, 0.0), frame)
    # The controller of the other one keeps the heading 0, whatever it is.
    driven.yaw, controlled.yaw = 2.0, 0.3
    fleet = Fleet(NAMES, process=process, startup_timeout=0.5)
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


@pytest.mark.parametrize("trouble", ["lost: nothing is heard", "flying; battery critical"])
def test_a_vehicle_that_is_in_trouble_ends_the_mission(fleet, controlled, driven, trouble):
    with pytest.raises(MissionError, match=f"cf2: {trouble}"), fleet:
        fleet.takeoff(0.8)
        driven.tell(trouble)
        fleet.wait(10.0)
    assert controlled.position[2] == 0.0


def test_a_landing_that_was_not_commanded_is_noticed(fleet, controlled):
    with pytest.raises(MissionError, match="cf1: it does not fly any more"), fleet:
        fleet.takeoff(0.8)
        controlled.be("descending")
        fleet.wait(10.0)


def test_who_refuses_to_take_off_is_named_and_the_others_land(fleet, controlled, driven):
    controlled.refusal = "the battery is low"
    with pytest.raises(MissionError, match="cf1: takeoff: the battery is low"), fleet:
        fleet.takeoff(0.8)
    assert "land" in driven.called()
    assert fleet.flying == []


def test_who_does_not_arrive_is_named(process, controlled, driven):
    fleet = Fleet(NAMES, process=process, startup_timeout=0.5, arrival_timeout=1.0)
    driven._on_setpoint = None
    text = r"cf2 is 1.00 m from \(1.00, 1.00, 1.00\): waited 1 s longer than planned; expected 0.15"
    with pytest.raises(MissionError, match=text), fleet:
        fleet["cf2"].takeoff(1.0)
        fleet["cf2"].go_to((1, 1, 1), wait=False)
        driven.position = [1.0, 0.0, 1.0]
        fleet.arrive()


@pytest.mark.parametrize("frame", [None, "world"])
def test_a_position_outlasts_simulated_time_that_runs_ahead_of_it(process, controlled, frame):
    driven = DriverVehicle(process, "cf2", (1.0, 0.0, 0.0), frame)
    with Fleet(NAMES, process=process, startup_timeout=0.5) as fleet:
        process.advance(1.0)
        # /clock has come, and what belongs to it is on its way: at 10 times real time within 0.2 s.
        driven.is_tracked = False
        process.set_clock(process.clock.time() + 2.0)
        assert fleet.position("cf2") == pytest.approx((1.0, 0.0, 0.0))
        process.advance_machine(0.6)
        with pytest.raises(MissionError, match="^cf2: its position is not known"):
            fleet.position("cf2")


@pytest.mark.parametrize(("frame", "step"), [(None, 0.0), ("world", 0.0), ("world", -3600.0)])
def test_who_is_not_tracked_any_more_does_not_arrive(process, controlled, frame, step):
    process.clock.wall_offset = 1.7e9
    driven = DriverVehicle(process, "cf2", (1.0, 0.0, 0.0), frame)
    fleet = Fleet(NAMES, process=process, startup_timeout=0.5)
    with pytest.raises(MissionError, match="^cf2: its position is not known"), fleet:
        fleet.takeoff(1.0)
        fleet["cf2"].go_to((1, 0.5, 1), wait=False)
        # It was at its goal when it was seen last.
        fleet.wait(0.2)
        driven.is_tracked = False
        # The clock may be set back meanwhile: its last pose is ahead of now then.
        process.clock.wall_offset += step
        fleet.arrive()
    # That it has landed is known by its supervisor.
    assert driven.called()[-2:] == ["land", "stop"]
    assert fleet.flying == []


def test_a_landing_is_seen_by_the_supervisor_alone(fleet, driven):
    with pytest.raises(MissionError, match="cf2: land: not on the ground 15 s after"), fleet:
        fleet.takeoff(1.0)
        driven.is_tracked = False
        driven.tell = lambda status: None
    assert driven.called()[-1] == "land"


def test_beside_the_table_a_vehicle_has_landed_when_it_flies_no_more(process, fleet, driven):
    """It is below the place where it took off before it is on the floor."""
    tell, last_calls = driven.tell, []

    def touch_down():
        last_calls.append(driven.called()[-1])
        tell("ready: armed")

    with fleet:
        fleet["cf2"].takeoff(1.0)
        driven.tell = lambda status: None
        process.handle("/floor").timer(10.0, touch_down)
    assert last_calls[:1] == ["land"]
    assert driven.called()[-1] == "stop"
    assert fleet.flying == []


def test_the_fixed_frame_is_the_drivers(process):
    process.transport.parameters["/this_process/frames/fixed"] = "hall"
    DriverVehicle(process, "cf2", (1.0, 0.0, 0.0), "hall")
    fleet = Fleet(["cf2"], process=process, startup_timeout=0.5)
    assert fleet.position("cf2") == (1.0, 0.0, 0.0)


def test_vehicles_behind_the_driver_do_not_begin_at_the_same_moment(process):
    for number in (1, 2):
        DriverVehicle(process, f"cf{number}", (number - 1.0, 0.0, 0.0))
    fleet = Fleet(NAMES, separation=0.95, process=process, startup_timeout=0.5)

    def mission(group):
        group.takeoff(1.0)
        group.go_to((1.0, 0.0, 0.0), relative=True)

    text = "expected at least 0.95 m; this happens if cf2 begins 0.15 s after the others"
    with pytest.raises(MissionError, match=text):
        fleet.dry_run(mission)
    with pytest.raises(MissionError, match=text), fleet:
        mission(fleet)


def test_all_vehicles_of_a_driver_start_by_its_service_for_all(process):
    vehicles = [DriverVehicle(process, f"cf{k}", (k - 1.0, 0.0, 0.0)) for k in (1, 2)]
    handle = process.handle("/this_process")
    requests = []

    def answer(request):
        requests.append(request)
        return StartTrajectoryResponse()

    for name in ("start_trajectory", "go_to"):
        handle.advertise_service(f"~all/{name}", StartTrajectory, answer)
    path = plan([(0, 0, 1), (0.2, 0, 1)])
    with Fleet(NAMES, process=process, startup_timeout=0.5) as fleet:
        fleet.takeoff(1.0)
        for vehicle in vehicles:
            vehicle.position[0] += 0.2
        fleet.follow(path, relative=True)
        (request,) = requests
        assert (request.trajectoryId, request.relative, request.timescale) == (0, False, 1.0)
        assert "start_trajectory" not in vehicles[0].called() + vehicles[1].called()
        fleet["cf1"].follow(path, relative=True)
        assert vehicles[0].called()[-1] == "start_trajectory"
        assert len(requests) == 1


def test_vehicles_that_are_streamed_to_start_one_by_one(process):
    vehicles = [DriverVehicle(process, f"cf{k}", (k - 1.0, 0.0, 0.0)) for k in (1, 2)]
    handle = process.handle("/this_process")
    for name in ("start_trajectory", "go_to"):
        handle.advertise_service(f"~all/{name}", StartTrajectory, lambda _: pytest.fail("all"))
    path = plan([(0, 0, 1), (0.2, 0, 1)])
    with Fleet(NAMES, process=process, startup_timeout=0.5) as fleet:
        fleet.takeoff(1.0)
        fleet["cf1"].follow(path, stream=True, wait=False)
        fleet.wait(0.2)
        vehicles[1].position[0] += 0.2
        fleet.adopt("cf1")
        fleet.follow(path, relative=True)
        assert all("start_trajectory" in vehicle.called() for vehicle in vehicles)


def test_vehicles_of_controllers_start_by_one_message(process):
    for number in (1, 2):
        ControllerVehicle(process, f"cf{number}", (number - 1.0, 0.0, 0.0))
    with Fleet(NAMES, process=process, startup_timeout=0.5) as fleet:
        fleet.takeoff(1.0)
        fleet.go_to((0.2, 0.0, 0.0), relative=True)
    (message,) = process.published("/all/start_trajectory")
    assert message.data == "/cf1/high_level /cf2/high_level"


def test_vehicles_of_a_graph_are_found_by_their_services():
    services = {
        **dict.fromkeys(["/cf1/go_to", "/cf1/takeoff", "/cf1/upload_trajectory"], "/driver"),
        **dict.fromkeys(["/cf2/high_level/go_to", "/cf2/high_level/takeoff"], "/cf2/high_level"),
        "/cf2/high_level/upload_trajectory": "/cf2/high_level",
        # One without a namespace.
        **dict.fromkeys(["/high_level/go_to", "/high_level/takeoff"], "/high_level"),
        "/high_level/upload_trajectory": "/high_level",
        "/all/high_level/go_to": "/fleet/services",
        "/driver/all/go_to": "/driver",
    }
    assert flown_vehicles(services) == {"cf1": "/driver", "cf2": "", "/": ""}


def test_a_fence_counts(process, controlled, driven):
    for side, value in (("min", -0.5), ("max", 0.5)):
        for axis in "xyz":
            process.transport.parameters[f"/cf1/geofence/box/{side}/{axis}"] = value * 3
    fleet = Fleet(NAMES, process=process, startup_timeout=0.5)
    with fleet:
        fleet.takeoff(1.0)
        with pytest.raises(MissionError, match="y is 1.8 m; expected -1.5 to 1.5 m"):
            fleet["cf1"].go_to((0.0, 1.8, 1.0))
        fleet["cf2"].go_to((1.0, 1.8, 1.0))


def test_the_buffers_of_the_fleet_process_count(process, controlled, driven):
    process.transport.parameters |= {"/cf1/buffer": 0.3, "/cf2/buffer": 0.35}
    fleet = Fleet(NAMES, process=process, startup_timeout=0.5)
    with fleet:
        fleet.takeoff(1.0)
        with pytest.raises(
            MissionError, match=r"at least 0.715 m \(the mission's separation is 0.3"
        ):
            fleet["cf1"].go_to((0.4, 0.0, 1.0))
        fleet["cf1"].go_to((0.2, 0.0, 1.0), duration=6.0)


def test_the_buffers_of_a_fleet_file_count(process, controlled, driven, tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(
        "robots:\n  cf1: {initial_position: [0, 0, 0]}\n  cf2: {initial_position: [1, 0, 0]}\n"
        "all: {buffer: 0.4}\n"
    )
    fleet = Fleet(path, process=process, startup_timeout=0.5)
    assert fleet.rules.buffers == {"cf1": 0.4, "cf2": 0.4}


def test_names_of_a_fleet_file(process, controlled, driven, tmp_path):
    path = tmp_path / "two.yaml"
    robots = "robots:\n  cf1: {initial_position: [0, 0, 0]}\n  cf2: {initial_position: [1, 0, 0]}\n"
    path.write_text(robots)
    assert Fleet(path, process=process, startup_timeout=0.5).names == NAMES
    path.write_text(robots + "  cf3: {initial_position: [1, 0]}\n")
    with pytest.raises(MissionError, match=r"two.yaml:4"):
        Fleet(str(path), process=process, startup_timeout=0.5)


@pytest.mark.parametrize(
    ("names", "text"),
    [
        (
            ["cf9"],
            "no takeoff and land, and no go_to, below /cf9 after 0.1 s; takeoff is offered",
        ),
        ([], r"the vehicles are \[\]; expected names"),
        (["cf1", "cf1"], "the vehicle 'cf1' is named twice"),
        ([1], r"the vehicles are \[1\]"),
    ],
)
def test_names_that_make_no_sense(process, controlled, driven, names, text):
    with pytest.raises(MissionError, match=text):
        Fleet(names, process=process, startup_timeout=0.1)


# Other missions.


def claim(process, mission, *words):
    """Publish what a mission that runs elsewhere does: who flies, and behind a bar who is its."""
    process.publish("/all/mission", String(" ".join((mission, *words))))


def test_a_vehicle_of_a_mission_that_runs_is_refused(process, controlled, driven):
    with Fleet(["cf1"], process=process, startup_timeout=0.5) as first:
        text = rf"cf1: in use by the running mission {first._mission}; wait for its end"
        with pytest.raises(MissionError, match=text):
            Fleet(NAMES, process=process, startup_timeout=0.5)
        Fleet(["cf2"], process=process, startup_timeout=0.5)
        first.takeoff(0.5)
    with Fleet(["cf1"], process=process, startup_timeout=0.5) as second:
        second.takeoff(0.5)


def test_a_mission_that_was_killed_has_no_vehicles(fleet, process):
    claim(process, "killed", "cf1", "|", *NAMES)
    with fleet:
        for seconds in (1.0, 3.5):
            process.advance(seconds)
            with pytest.raises(
                MissionError, match="cf1, cf2: in use by the running mission killed"
            ):
                fleet.takeoff(0.5)
        process.advance(1.5)
        fleet.takeoff(0.5)
        assert fleet.flying == NAMES


def test_a_mission_whose_vehicles_another_one_has_leaves_them(fleet, process, controlled, driven):
    with pytest.raises(MissionError, match="cf2: in use by the running mission other"), fleet:
        fleet.takeoff(0.8)
        # It was stopped for a while.
        claim(process, "other", "cf2", "|", "cf2")
        fleet.go_to((0.0, 0.5, 0.0), relative=True)
    assert "land" not in driven.called()
    assert controlled.position[2] == 0.0


def test_bodies_that_nobody_flies_are_obstacles(process, controlled, driven):
    process.transport.parameters["/fleet/obstacles"] = {
        "turtlebot1": {"frame": "turtle", "buffer": 0.3}
    }
    fleet = Fleet(NAMES, process=process, startup_timeout=0.5)
    header = Header(0, process.clock.stamp(), "world")
    transform = Transform(Vector3(-1.0, 0.0, 0.8), Quaternion(w=1.0))
    with fleet:
        # It has not been seen yet.
        fleet.takeoff(0.8)
        process.publish("/tf", TFMessage([TransformStamped(header, "turtle", transform)]))
        with pytest.raises(MissionError, match="turtlebot1 and cf1 would be .* m apart"):
            fleet["cf1"].go_to((-1.5, 0.0, 0.8))
        fleet["cf1"].go_to((0.0, 0.8, 0.8))


def test_vehicles_of_other_missions_are_obstacles(fleet, process, controlled, driven):
    other = ControllerVehicle(process, "cf3", (-1.0, 0.0, 0.8))
    process.transport.parameters["/cf3/buffer"] = 0.3
    process.timers().add(0.5, lambda: claim(process, "other", "cf3", "|", "cf3"))
    process.advance(0.5)

    def mission(group):
        group.takeoff(0.8)
        group["cf1"].go_to((-1.5, 0.0, 0.8))

    with fleet:
        with pytest.raises(MissionError, match="cf3 and cf1 would be .* m apart"):
            fleet.fly(mission)
        fleet.takeoff(0.8)
        with pytest.raises(MissionError, match="cf3 and cf1 would be .* m apart"):
            fleet["cf1"].go_to((-1.5, 0.0, 0.8))
        fleet["cf1"].go_to((0.0, 0.8, 0.8))
        fleet["cf1"].go_to((-1.0, 0.8, 0.8))
        # It flies beneath.
        fleet["cf1"].go_to((-1.0, 0.8, 1.8))
        fleet["cf1"].go_to((-1.0, 0.0, 1.8))
    assert math.dist(controlled.position[:2], other.position[:2]) > 0.3
    assert other.position == [-1.0, 0.0, 0.8]


def test_a_vehicle_of_another_mission_that_flies_is_somewhere(fleet, process):
    claim(process, "other", "cf3", "|", "cf3")
    text = "cf3: its position is not known, and another mission flies it"
    with fleet, pytest.raises(MissionError, match=text):
        fleet.takeoff(0.8)
