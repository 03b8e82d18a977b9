"""The firmware's commands to simulated vehicles and to groups of them, with all arguments."""

import genpy
import pytest
from geometry_msgs.msg import Point
from simulated_fleet import Swarm
from std_srvs.srv import EmptyRequest

from crazyflie_driver import srv
from crazyflie_driver.trajectory_messages import to_message
from crazyflie_fleet.fleet_services_node import START_LIMIT
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import at_rest
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import ServiceError

ODD, EVEN = 1, 2


def seconds(duration):
    return genpy.Duration.from_sec(duration)


class Swarm3(Swarm):
    """Three vehicles; cf1 and cf3 are in one group, cf2 is in another."""

    def __init__(self):
        super().__init__(fleet={"n": 3})
        for name, mask in (("cf1", ODD), ("cf2", EVEN), ("cf3", ODD)):
            self.call(f"/{name}/high_level/set_group_mask", srv.SetGroupMaskRequest(mask))

    def heights(self):
        return [self.position(name)[2] for name in ("cf1", "cf2", "cf3")]


@pytest.fixture
def swarm():
    return Swarm3()


def test_a_group_takes_off_goes_and_lands(swarm):
    height = srv.TakeoffRequest(ODD, 0.6, seconds(2.0))
    swarm.call("/all/high_level/takeoff", height)
    assert swarm.heights() == pytest.approx([0.6, 0.0, 0.6], abs=0.05)
    swarm.call("/cf2/high_level/takeoff", height)
    assert swarm.heights()[1] == 0.0
    before = swarm.position("cf3")
    swarm.call(
        "/all/high_level/go_to",
        srv.GoToRequest(ODD, True, Point(0.3, 0.0, 0.2), 0.0, seconds(2.0)),
    )
    swarm.process.advance(2.5)
    expected = [before[0] + 0.3, before[1], before[2] + 0.2]
    assert swarm.position("cf3") == pytest.approx(expected, abs=0.05)
    swarm.call("/all/high_level/land", srv.LandRequest(EVEN, 0.0, seconds(2.0)))
    swarm.process.advance(6.0)
    assert swarm.heights() == pytest.approx([0.8, 0.0, 0.8], abs=0.05)
    swarm.call("/all/high_level/land", srv.LandRequest(0, 0.0, seconds(2.0)))
    swarm.process.advance(6.0)
    assert swarm.heights() == pytest.approx([0.0, 0.0, 0.0], abs=0.02)


def test_a_takeoff_takes_the_time_that_it_is_given(swarm):
    # Commands are followed before the takeoff server's own time is over.
    swarm.process.call("/cf1/high_level/takeoff", srv.TakeoffRequest(0, 1.0, seconds(2.0)))
    swarm.process.advance(2.5)
    x, y, z = swarm.position("cf1")
    assert z == pytest.approx(1.0, abs=0.06)
    goal = srv.GoToRequest(0, False, Point(x + 0.5, y, 1.0), 0.0, seconds(1.4))
    swarm.process.call("/cf1/high_level/go_to", goal)
    swarm.process.advance(1.5)
    assert swarm.position("cf1") == pytest.approx((x + 0.5, y, 1.0), abs=0.1)


def command(swarm, command, *names, **details):
    request = srv.CommandVehicles._request_class(names=names, command=command, **details)
    return swarm.call("/all/command", request)


def test_some_vehicles_are_commanded_by_one_call(swarm):
    command(swarm, "take off", "cf1", "cf2", height=0.6, duration=seconds(2.0))
    assert swarm.heights() == pytest.approx([0.6, 0.6, 0.0], abs=0.05)
    (x1, y1, _), (x2, y2, _) = swarm.position("cf1"), swarm.position("cf2")
    goals = [Point(x1, y1 + 0.4, 0.6), Point(x2, y2, 0.9)]
    command(swarm, "go to", "cf1", "cf2", goals=goals, yaws=[0.0, 0.0], duration=seconds(2.0))
    swarm.process.advance(2.5)
    assert swarm.position("cf1") == pytest.approx((x1, y1 + 0.4, 0.6), abs=0.05)
    assert swarm.position("cf2") == pytest.approx((x2, y2, 0.9), abs=0.05)
    command(swarm, "land", "cf2")
    assert swarm.heights() == pytest.approx([0.6, 0.0, 0.0], abs=0.05)


def test_some_vehicles_take_off_all_or_none(swarm):
    swarm.process.advance(START_LIMIT)
    status(swarm.process, "cf2", "the battery has 3.0 V")
    takeoff = {"height": 0.6, "duration": seconds(2.0)}
    with pytest.raises(ServiceError, match="no vehicle takes off: 1 of 3 vehicles: cf2: the batt"):
        command(swarm, "take off", "cf1", "cf2", **takeoff)
    command(swarm, "take off", "cf1", "cf3", **takeoff)
    assert swarm.heights() == pytest.approx([0.6, 0.0, 0.6], abs=0.05)


def test_when_one_refuses_to_go_the_others_hold(swarm):
    command(swarm, "take off", "cf1", "cf3", height=0.6, duration=seconds(2.0))
    before = swarm.position("cf1")
    goals, yaws = [Point(1.0, 1.0, 0.6), Point(2.0, 0.0, 0.6)], [0.0, 0.0]
    with pytest.raises(ServiceError, match="1 of 3 vehicles: cf2: .* on the ground"):
        command(swarm, "go to", "cf1", "cf2", goals=goals, yaws=yaws, duration=seconds(2.0))
    swarm.process.advance(2.5)
    assert swarm.position("cf1") == pytest.approx(before, abs=0.05)
    command(swarm, "hold", "cf1", "cf3")
    with pytest.raises(ServiceError, match="cf1: .* there is no emergency"):
        command(swarm, "reset", "cf1")


@pytest.mark.parametrize(
    ("what", "names", "complaint"),
    [("land", ["cf1", "cf9"], "cf9: not of this"), ("go to", ["cf1"], "expected take off, land")],
)
def test_a_command_that_makes_no_sense_is_refused(swarm, what, names, complaint):
    with pytest.raises(ServiceError, match=complaint):
        command(swarm, what, *names)


def test_trajectories_begin_at_the_same_moment(swarm):
    swarm.call("/all/high_level/takeoff", srv.TakeoffRequest(0, 1.0, seconds(2.0)))
    piece = smooth_piece(at_rest((0.0, 0.0, 0.0), 0.0), (0.4, 0.0, 0.3), 0.0, 3.0)
    for name in ("cf1", "cf2", "cf3"):
        upload = srv.UploadTrajectoryRequest(7, 0, [to_message(piece)])
        swarm.call(f"/{name}/high_level/upload_trajectory", upload)
    start = {name: swarm.position(name) for name in ("cf1", "cf2", "cf3")}
    request = srv.StartTrajectoryRequest(ODD, 7, 1.0, False, True)
    swarm.call("/all/start_trajectory", request)
    swarm.process.advance(1.5)
    for name, share in (("cf1", 0.5), ("cf2", 0.0), ("cf3", 0.5)):
        moved = [a - b for a, b in zip(swarm.position(name), start[name], strict=True)]
        # A controller follows a little behind.
        assert moved == pytest.approx([share * 0.4, 0.0, share * 0.3], abs=0.1)
    references = [swarm.process.published(f"/{name}/ref")[-1] for name in ("cf1", "cf3")]
    assert references[0].header.stamp == references[1].header.stamp
    assert references[0].state.x_dot == references[1].state.x_dot > 0.1


@pytest.mark.parametrize("service", ["/all/go_to", "/all/high_level/go_to"])
def test_vehicles_cannot_all_go_to_one_place(swarm, service):
    request = srv.GoToRequest(0, False, Point(0.0, 0.0, 1.0), 0.0, seconds(2.0))
    with pytest.raises(ServiceError, match=f"{service} refused: all vehicles cannot go to one pl"):
        swarm.call(service, request)


def test_refusals_name_the_vehicles(swarm):
    request = srv.GoToRequest(ODD, True, Point(0.0, 0.0, 0.1), 0.0, seconds(2.0))
    with pytest.raises(ServiceError, match="2 of 3 vehicles: cf1, cf3: .* on the ground"):
        swarm.call("/all/high_level/go_to", request)


def test_nothing_is_published_by_vehicles_that_do_not_move(swarm):
    swarm.call("/all/high_level/takeoff", srv.TakeoffRequest(0, 0.6, seconds(2.0)))
    count = len(swarm.process.published("/cf1/ref"))
    swarm.process.advance(2.0)
    assert len(swarm.process.published("/cf1/ref")) == count


def status(process, name, refusal):
    """Make a vehicle on the ground report why it would not take off."""
    message = FlightStatus(state=FlightStatus.ON_GROUND, takeoff_refusal=refusal)
    process.publish(f"/{name}/in_flight_flight_status", message)


def test_a_vehicle_that_is_landed_in_a_common_takeoff_does_not_land_the_others(swarm):
    answer = swarm.process.call("/takeoff_all", EmptyRequest())
    swarm.process.advance(0.5)
    swarm.process.call("/cf1/land", EmptyRequest())
    swarm.advance_until(answer.done, 20.0)
    with pytest.raises(ServiceError, match="^1 of 3 vehicles: cf1: takeoff aborted: /cf1/land was"):
        answer.result(0)
    swarm.process.advance(3.0)
    assert swarm.heights() == pytest.approx([0.0, 1.0, 1.0], abs=0.1)


def test_a_group_takes_off_whatever_the_others_would_do(swarm):
    status(swarm.process, "cf2", "the battery has 3.0 V")
    swarm.call("/all/high_level/takeoff", srv.TakeoffRequest(ODD, 0.6, seconds(2.0)))
    assert swarm.heights() == pytest.approx([0.6, 0.0, 0.6], abs=0.05)


def test_a_fleet_that_has_just_started_takes_off_as_soon_as_all_would(swarm):
    late = "states on state are 0.6 s old when they come"
    status(swarm.process, "cf2", late)
    answer = swarm.process.call("/takeoff_all", EmptyRequest())
    swarm.process.advance(3.0)
    assert (answer.done(), swarm.heights()) == (False, [0.0, 0.0, 0.0])
    (said,) = [text for text in swarm.process.logged("info") if "takeoff waits" in text]
    assert said.endswith(f"takeoff waits for vehicles, 10 s at most: 1 of 3 vehicles: cf2: {late}")
    status(swarm.process, "cf2", "")
    swarm.advance_until(answer.done, 10.0)
    answer.result(0)
    assert swarm.heights() == pytest.approx([1.0, 1.0, 1.0], abs=0.2)


@pytest.mark.parametrize(("age", "waits"), [(0.0, 10.0), (60.0, 0.0)])
def test_a_fleet_of_which_one_would_refuse_stays_on_the_ground(swarm, age, waits):
    swarm.process.advance(age)
    status(swarm.process, "cf2", "the battery is low")
    begin = swarm.process.clock.time()
    refused = "no vehicle takes off: 1 of 3 vehicles: cf2: the battery is low"
    with pytest.raises(ServiceError, match=refused):
        swarm.call("/takeoff_all", seconds=20.0)
    assert swarm.process.clock.time() - begin == pytest.approx(waits, abs=0.6)
    swarm.process.advance(3.0)
    assert swarm.heights() == [0.0, 0.0, 0.0]


def test_a_fault_of_a_takeoff_that_waits_is_one_of_the_node(swarm, monkeypatch):
    status(swarm.process, "cf2", "the battery is low")
    answer = swarm.process.call("/takeoff_all", EmptyRequest())
    node, aborted = swarm.nodes["/fleet"], []
    monkeypatch.setattr(node._lander, "abort", lambda: aborted.append(True))
    monkeypatch.setattr(node, "_takeoff_refusals", lambda names: {}["a bug"])
    swarm.process.advance(0.5)
    with pytest.raises(ServiceError, match="/fleet: KeyError"):
        answer.result(0)
    assert aborted
    (said,) = swarm.process.logged("error")
    assert "Traceback" in said and "a bug" in said


def test_if_one_refuses_against_its_word_the_others_land_again(swarm):
    swarm.call("/cf3/emergency")
    swarm.process.advance(0.5)
    status(swarm.process, "cf3", "")
    text = "no vehicle takes off: 1 of 3 vehicles: cf3: .*emergency.*; those that had begun have la"
    with pytest.raises(ServiceError, match=text):
        swarm.call("/takeoff_all", seconds=20.0)
    assert swarm.heights() == pytest.approx([0.0, 0.0, 0.0], abs=0.02)
    topics = [f"/cf{k}/in_flight_flight_status" for k in (1, 2, 3)]
    states = [swarm.process.published(topic)[-1].state for topic in topics]
    assert states == [FlightStatus.ON_GROUND] * 3


def test_a_vehicle_that_has_not_begun_does_not_fly(swarm):
    for name in ("cf2", "cf3"):
        swarm.call(f"/{name}/emergency")
    swarm.process.advance(0.5)
    for name in ("cf2", "cf3"):
        status(swarm.process, name, "")
    with pytest.raises(ServiceError, match="no vehicle takes off") as error:
        swarm.call("/takeoff_all", seconds=20.0)
    assert "MAY STILL FLY" not in str(error.value)


def test_a_second_call_takes_the_rest(swarm):
    swarm.call("/cf2/takeoff")
    swarm.call("/takeoff_all")
    assert swarm.heights() == pytest.approx([1.0, 1.0, 1.0], abs=0.2)
    said = swarm.process.logged("info")
    assert any(t.endswith("flying already: cf2; taking off: cf1, cf3") for t in said)
    with pytest.raises(ServiceError, match="refused: all vehicles are flying already"):
        swarm.call("/takeoff_all")
