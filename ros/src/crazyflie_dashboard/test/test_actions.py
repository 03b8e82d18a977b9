"""Commands: what is called, and what is refused."""

import math
import threading
from concurrent.futures import Future
from pathlib import Path

import pytest
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.msg import Config
from fake_fleet import FakeFleet, FakeLane
from geometry_msgs.msg import Point, Quaternion, Vector3
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_dashboard.dashboard import Dashboard
from crazyflie_dashboard.discovery import Graph
from crazyflie_dashboard.master import MasterError
from crazyflie_dashboard.page_data import Command, DryRunResult
from crazyflie_dashboard.snapshot import Action
from crazyflie_driver import srv
from crazyflie_fleet.high_level_services import COMMAND, TAKEOFF_LEAD
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.tf.frame_tree import StampedPose, encode_poses

LIMIT = 10.0  # s.


@pytest.fixture
def fleet():
    found = FakeFleet()
    found.find()
    found.dashboard.pages.take(found.page)
    return found


def called(fleet):
    return [service for service, _ in fleet.calls]


def test_a_takeoff_of_some_calls_their_services(fleet):
    assert fleet.command(Action.TAKEOFF, ["cf1", "cf3"], height=0.8) == {"cf1": "", "cf3": ""}
    assert called(fleet) == ["/cf1/high_level/takeoff", "/cf3/high_level/takeoff"]
    request = fleet.calls[0][1]
    assert request.height == pytest.approx(0.8)
    assert request.duration.to_sec() == pytest.approx(1.6 + TAKEOFF_LEAD)


def test_each_vehicle_has_its_own_outcome_in_the_words_of_its_service(fleet):
    fleet.refusals["/cf2/high_level/takeoff"] = "the battery is at 2.9 V; expected 3.2 V"
    assert fleet.command(Action.TAKEOFF) == {
        "cf1": "is landed: not all of them can take off",
        "cf2": "the battery is at 2.9 V; expected 3.2 V",
        "cf3": "is landed: not all of them can take off",
    }
    assert {"/cf1/high_level/land", "/cf3/high_level/land"} <= {*called(fleet)}


def test_some_take_off_as_a_whole_or_not_at_all(fleet):
    reason = "the battery is at 2.9 V; expected 3.2 V"
    fleet.report("cf2", FlightStatus.ON_GROUND, takeoff_refusal=reason)
    assert fleet.command(Action.TAKEOFF) == {
        "cf1": "not all of them can take off",
        "cf2": reason,
        "cf3": "not all of them can take off",
    }
    assert fleet.calls == []


def test_a_fleet_is_commanded_by_one_call(fleet):
    fleet.offer(COMMAND, srv.CommandVehicles)
    some = ["cf1", "cf3"]
    assert fleet.command(Action.TAKEOFF, some, height=0.8) == dict.fromkeys(some, "")
    ((name, request),) = fleet.calls
    assert (name, request.names, request.command) == (COMMAND, some, "take off")
    assert request.height == pytest.approx(0.8)
    assert request.duration.to_sec() == pytest.approx(1.6 + TAKEOFF_LEAD)
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    outcomes = fleet.command(Action.GO_TO, goal=(1.5, 1.0, 1.0))
    assert outcomes == dict.fromkeys(fleet.names, "")
    fleet.command(Action.HOLD)
    fleet.command(Action.LAND, some)
    assert called(fleet) == [COMMAND] * 4
    go, hold, land = (request for _, request in fleet.calls[1:])
    assert [(p.x, p.y, p.z) for p in go.goals] == [(0.5 + k, 1.0, 1.0) for k in range(3)]
    assert (hold.command, land.command, land.names) == ("hold", "land", some)
    fleet.command(Action.LAND, ["cf2"])
    assert called(fleet)[4:] == ["/cf2/high_level/land"]


def test_the_answer_of_a_fleet_is_that_of_each_vehicle(fleet):
    fleet.offer(COMMAND, srv.CommandVehicles)
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    refusal = fleet.refusals[COMMAND] = "1 of 3 vehicles: cf2: the vehicle is landing"
    outcomes = fleet.command(Action.GO_TO, goal=(1.5, 1.0, 1.0))
    assert outcomes == dict.fromkeys(fleet.names, refusal)
    # Nobody is on the way there.
    del fleet.refusals[COMMAND]
    assert fleet.command(Action.GO_TO, ["cf2"], goal=(1.0, -1.0, 1.0)) == {"cf2": ""}


@pytest.mark.parametrize("goal", [(500.0, 0.0, 1.0), (0.0, -10.5, 1.0), (0.0, 0.0, 60.0)])
def test_a_goal_far_away_is_refused_where_there_is_no_fence(fleet, goal):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    with pytest.raises(RefusalError, match=r"cf1 would leave the limits of goals \(~goal_limit"):
        fleet.command(Action.GO_TO, ["cf1"], goal=goal)
    assert fleet.calls == []
    fleet.fly(cf1=(14.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    assert fleet.command(Action.GO_TO, ["cf1"], goal=(13.0, 0.0, 1.0)) == {"cf1": ""}


def test_a_formation_may_go_to_the_ground_whatever_the_rounding(fleet):
    fleet.fly(cf1=(0.0, 0.0, 0.1), cf2=(4.0, 0.0, 0.7), cf3=(8.0, 2.0, 0.1))
    places = ["cf1", "cf3"]
    assert fleet.command(Action.GO_TO, places, goal=(4.0, 1.0, 0.0)) == dict.fromkeys(places, "")
    middle = (0.1 + 0.7) / 2.0
    with pytest.raises(RefusalError, match="cf1 would go to z = -0.30 m; expected 0 or more"):
        fleet.command(Action.GO_TO, ["cf1", "cf2"], goal=(2.0, 0.0, middle - 0.4))


def test_distances_that_round_to_the_limit_are_shown_with_more_digits(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    with pytest.raises(RefusalError, match=r"would be 0.299 m apart, .* at least 0.300 m"):
        fleet.command(Action.GO_TO, ["cf1"], goal=(0.701, 0.0, 1.0))


def test_a_goal_outside_of_the_room_of_the_world_file_is_refused(fleet):
    topics = {**fleet.graph.topics, "/world/markers": MarkerArray._type}
    fleet.graph = Graph(topics, topics, fleet.graph.services)
    fleet.process.advance(2.1)
    turn = math.sqrt(0.5)
    walls = [Marker(type=Marker.CUBE, scale=Vector3(4.0, 0.1, 2.5)) for _ in range(3)]
    for wall, (x, y) in zip(walls, ((0.0, 2.0), (0.0, -2.0), (3.0, 0.0)), strict=True):
        wall.pose.position = Point(x, y, 1.25)
    walls[2].pose.orientation = Quaternion(0.0, 0.0, turn, turn)
    fleet.process.publish("/world/markers", MarkerArray(walls))
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    with pytest.raises(RefusalError, match="the room of the world file: x is 3.10 m; .* 3.05 m"):
        fleet.command(Action.GO_TO, ["cf1"], goal=(3.1, -1.0, 1.0))
    with pytest.raises(RefusalError, match="the room of the world file: z is 2.60 m; .* 2.5 m"):
        fleet.command(Action.GO_TO, ["cf1"], goal=(0.0, -1.0, 2.6))


def test_going_somewhere_takes_as_long_as_the_speed_says(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    assert fleet.command(Action.GO_TO, ["cf2"], goal=(1.0, 2.0, 1.0), speed=0.5) == {"cf2": ""}
    ((service, request),) = fleet.calls
    assert service == "/cf2/high_level/go_to"
    assert (request.goal.x, request.goal.y, request.goal.z) == (1.0, 2.0, 1.0)
    assert request.duration.to_sec() == pytest.approx(4.0)
    assert not request.relative


@pytest.mark.parametrize(
    "details",
    [
        {"goal": (math.nan, 0.0, 1.0)},
        {"goal": (0.0, 0.0, math.inf)},
        {"goal": None},
        {"goal": (0.0, 0.0, -1.0)},
        {"goal": (0.0, 0.0, 1.0), "speed": 0.0},
        {"goal": (0.0, 0.0, 1.0), "speed": 50.0},
        {"goal": (0.0, 0.0, 1.0), "yaw": math.nan},
    ],
)
def test_moves_that_make_no_sense_are_refused(fleet, details):
    with pytest.raises(RefusalError, match="go to: .*expected"):
        fleet.command(Action.GO_TO, **{"names": ["cf1"], **details})
    assert fleet.calls == []


@pytest.mark.parametrize("age", [1.01, 60.0, -5.0, math.nan])
@pytest.mark.parametrize("action", [Action.TAKEOFF, Action.LAND])
def test_what_has_waited_is_not_carried_out(fleet, action, age):
    with pytest.raises(RefusalError, match="old; expected at most 1 s; nothing was done"):
        fleet.command(action, age=age)
    assert fleet.calls == []


def test_a_service_that_has_gone_is_not_called_when_it_comes_back(fleet):
    services = fleet.process.transport.services
    gone = services.pop("/cf1/high_level/takeoff")
    outcome = fleet.command(Action.TAKEOFF, ["cf1", "cf2"])
    assert "/cf1/high_level/takeoff" in outcome["cf1"]
    assert outcome["cf2"] == "is landed: not all of them can take off"
    services["/cf1/high_level/takeoff"] = gone
    fleet.process.advance(120.0)
    assert "/cf1/high_level/takeoff" not in called(fleet)


def goals(fleet):
    return {
        service.split("/")[1]: (request.goal.x, request.goal.y, request.goal.z)
        for service, request in fleet.calls
    }


def test_vehicles_above_each_other_keep_their_distance(fleet):
    fleet.fly(cf1=(0.0, 0.0, 0.5), cf2=(0.0, 0.0, 1.5), cf3=(3.0, 0.0, 1.0))
    fleet.command(Action.GO_TO, ["cf1", "cf2"], goal=(1.0, 1.0, 1.2))
    assert goals(fleet) == {
        "cf1": pytest.approx((1.0, 1.0, 0.7)),
        "cf2": pytest.approx((1.0, 1.0, 1.7)),
    }
    first, second = (request.duration for _, request in fleet.calls)
    assert first == second


def test_all_go_or_none(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    fleet.report("cf2", FlightStatus.ON_GROUND)
    assert fleet.command(Action.GO_TO, goal=(1.0, 1.0, 1.0)) == {
        "cf1": "not all of them can go",
        "cf2": "the vehicle is on the ground; expected it to fly",
        "cf3": "not all of them can go",
    }
    assert fleet.calls == []


def test_those_that_have_begun_are_held_when_one_refuses(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    fleet.refusals["/cf2/high_level/go_to"] = "the vehicle is landing; expected it to fly"
    outcome = fleet.command(Action.GO_TO, ["cf1", "cf2"], goal=(0.5, 1.0, 1.0))
    assert outcome["cf1"] == "is held: not all of them can go"
    service, request = fleet.calls[-1]
    assert (service, request.relative) == ("/cf1/high_level/go_to", True)
    assert (request.goal.x, request.goal.y, request.goal.z) == (0.0, 0.0, 0.0)


def test_those_that_have_begun_are_held_when_services_disappear_meanwhile(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    fleet.refusals["/cf3/high_level/go_to"] = "the vehicle is landing; expected it to fly"
    advertised = fleet.process.transport.services

    def refuse(request, answer=advertised["/cf3/high_level/go_to"]):
        """Let the dashboard find that cf1 has no services any more, then answer."""
        services = {k: v for k, v in fleet.graph.services.items() if not k.startswith("/cf1/")}
        fleet.graph = Graph(fleet.graph.topics, fleet.graph.topics, services)
        fleet.process.advance(2.1)
        return answer(request)

    advertised["/cf3/high_level/go_to"] = refuse
    outcome = fleet.command(Action.GO_TO, goal=(0.5, 1.0, 1.0))
    assert outcome["cf1"] == outcome["cf2"] == "is held: not all of them can go"
    held = [service for service, request in fleet.calls if request.relative]
    assert held == ["/cf1/high_level/go_to", "/cf2/high_level/go_to"]


@pytest.mark.parametrize("x", [0.9, 4.0])
def test_a_way_that_comes_too_near_to_another_vehicle_is_refused(fleet, x):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    fleet.master.values["/cf2/buffer"] = 0.2
    with pytest.raises(
        RefusalError, match=r"cf1 and cf2 would be 0.\d+ m apart, .* at least 0.37 m"
    ):
        fleet.command(Action.GO_TO, ["cf1"], goal=(x, 0.0, 1.0))
    assert fleet.calls == []
    assert fleet.command(Action.GO_TO, ["cf1"], goal=(x, -4.0, 1.0)) == {"cf1": ""}


def test_a_move_that_is_on_its_way_counts_until_it_is_left(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(4.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    fleet.command(Action.GO_TO, ["cf1"], goal=(2.0, 0.0, 1.0))
    with pytest.raises(RefusalError, match="cf1 and cf2 would be"):
        fleet.command(Action.GO_TO, ["cf2"], goal=(2.0, 0.0, 1.0))
    # Another command has led it elsewhere.
    fleet.send_poses(places={"cf1": (0.0, 3.0, 1.0), "cf2": (4.0, 0.0, 1.0)})
    assert fleet.command(Action.GO_TO, ["cf2"], goal=(2.0, 0.0, 1.0)) == {"cf2": ""}


def test_vehicles_that_are_too_near_may_fly_apart(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(0.2, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    assert fleet.command(Action.GO_TO, ["cf1"], goal=(-1.0, 0.0, 1.0)) == {"cf1": ""}


def test_a_goal_is_given_to_a_vehicle_in_its_own_frame(fleet):
    half = math.sqrt(0.5)
    for _ in range(2):
        stamp = fleet.process.clock.nanoseconds()
        above = StampedPose("map", "world", stamp, (5.0, 0.0, 0.0), (0.0, 0.0, half, half))
        fleet.process.publish("/tf_static", encode_poses([above]))
        fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 0.0, 1.0))
    assert fleet.dashboard.scene().fixed_frame == "map"
    assert fleet.vehicles["cf2"].position == pytest.approx((5.0, 1.0, 1.0))
    fleet.master.values["/cf2/high_level/reference/yaw"] = True
    fleet.command(Action.GO_TO, ["cf2"], goal=(4.0, 1.5, 1.0), yaw=math.pi / 2)
    assert goals(fleet) == {"cf2": pytest.approx((1.5, 1.0, 1.0))}
    assert fleet.calls[0][1].yaw == pytest.approx(0.0)
    fleet.master.values["/cf2/high_level/frames/fixed"] = "elsewhere"
    with pytest.raises(RefusalError, match="cf2 is commanded in the frame elsewhere, .* shows map"):
        fleet.command(Action.GO_TO, ["cf2"], goal=(4.0, 1.0, 1.0))


def test_a_goal_outside_of_the_geofence_is_refused(fleet):
    topic = "/cf2/geofence/parameter_updates"
    topics = {**fleet.graph.topics, topic: Config._type}
    fleet.graph = Graph(topics, topics, fleet.graph.services)
    fleet.process.advance(2.1)
    fleet.process.publish(topic, encode_config({"box/max/x": 1.5}))
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(1.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    with pytest.raises(RefusalError, match=r"cf2 would leave its geofence: x is 1.60 m; .* 1.5 m"):
        fleet.command(Action.GO_TO, ["cf1", "cf2"], goal=(1.1, 0.0, 1.0))
    assert fleet.calls == []
    assert fleet.command(Action.GO_TO, ["cf2"], goal=(1.4, 0.0, 1.0)) == {"cf2": ""}


def test_a_vehicle_that_is_stale_goes_nowhere_and_still_lands(fleet):
    fleet.process.advance(1.0)
    assert fleet.vehicles["cf1"].is_stale
    refused = fleet.command(Action.GO_TO, ["cf1"], goal=(0.0, 0.0, 1.0))["cf1"]
    assert "its position is not known" in refused
    assert fleet.command(Action.LAND, ["cf1"]) == {"cf1": ""}
    assert called(fleet) == ["/cf1/high_level/land"]


def test_what_a_vehicle_does_not_have_is_reported(fleet):
    assert fleet.command(Action.REBOOT, ["cf1"]) == {"cf1": "reboot: it has no service for it"}
    assert fleet.command(Action.LAND, ["cf9"]) == {"cf9": "land: there is no such vehicle"}
    with pytest.raises(RefusalError, match="no vehicle is chosen"):
        fleet.command(Action.LAND, [])


def test_a_page_without_control_stops_motors_only(fleet):
    fleet.dashboard.pages.release(fleet.page)
    with pytest.raises(RefusalError, match="no page has control; take it first"):
        fleet.command(Action.LAND)
    fleet.dashboard.emergency(None, 0.0)
    fleet.dashboard.emergency(("cf1", "/"), 0.0)
    assert fleet.lane.stopped == [None, ["/cf1/emergency", "/emergency"]]


@pytest.mark.parametrize("height", [0.0, 0.05, 5.1, math.nan])
def test_a_takeoff_to_no_height_of_a_room_is_refused(fleet, height):
    with pytest.raises(RefusalError, match="take off: .*expected"):
        fleet.command(Action.TAKEOFF, height=height)
    assert fleet.calls == []


@pytest.mark.parametrize("action", [Action.DISARM, Action.REBOOT])
def test_a_vehicle_in_flight_is_not_disarmed(fleet, action):
    services = {**fleet.graph.services, "/cf1/arm": "/fleet", "/cf1/reboot": "/fleet"}
    fleet.graph = Graph(fleet.graph.topics, fleet.graph.topics, services)
    fleet.process.advance(2.1)
    fleet.report("cf1", FlightStatus.FLYING)
    assert fleet.command(action, ["cf1"]) == {
        "cf1": f"{action.value}: the vehicle is flying; expected it to be on the ground"
    }


def test_commands_refusals_and_control_are_logged(fleet):
    fleet.refusals["/cf2/high_level/takeoff"] = "the battery is at 2.9 V"
    fleet.command(Action.TAKEOFF, ["cf1", "cf2"])
    with pytest.raises(RefusalError):
        fleet.command(Action.LAND, age=3.0)
    fleet.dashboard.pages.release(fleet.page)
    info, warn = (" | ".join(fleet.process.logged(level)) for level in ("info", "warn"))
    assert "page 1 has control" in info
    assert "page 1: take off cf1, cf2" in info
    assert "page 1: take off cf1, cf2 to 1 m: refused, 0/2 accepted; cf2: the battery" in warn
    assert "page 1: land cf1, cf2, cf3: refused, the command is 3.0 s old" in warn
    assert "page 1 has given up control" in info


def test_a_command_is_logged_as_done_when_the_vehicle_has_arrived(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0))
    fleet.command(Action.GO_TO, ["cf1"], goal=(0.0, 2.0, 1.0))
    fleet.process.advance(1.0)
    fleet.fly(cf1=(0.0, 1.0, 1.0))
    line = "page 1: go to cf1 to (0.00, 2.00, 1.00) m"
    assert [line in each for each in fleet.process.logged("info")].count(True) == 1
    fleet.process.advance(1.0)
    fleet.fly(cf1=(0.0, 2.0, 1.0))
    fleet.process.advance(0.5)
    assert f"{line}: done, after 2 s" in fleet.process.logged("info")[-1]


def test_what_a_page_asks_for_does_not_wait_for_callbacks_of_the_node(fleet):
    handle = fleet.process.handle("/busy")
    dashboard = Dashboard(handle, fleet.master, FakeLane(), [])
    is_busy, goes_on = threading.Event(), threading.Event()

    def callback():
        is_busy.set()
        goes_on.wait(LIMIT)

    threading.Thread(target=handle.submit, args=(callback,), daemon=True).start()
    assert is_busy.wait(LIMIT)
    page = dashboard.pages.open(str)
    dashboard.watch(page, ["cf1"])
    answer = dashboard.command(page, Command(Action.LAND, ("cf1",), 0.0))
    assert not goes_on.is_set() and not answer.done()
    goes_on.set()
    with pytest.raises(RefusalError, match="no page has control"):
        answer.result(LIMIT)
    dashboard.close()


def test_hold_keeps_vehicles_where_they_are(fleet):
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(4.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    fleet.command(Action.GO_TO, ["cf1"], goal=(2.0, 0.0, 1.0))
    assert fleet.command(Action.HOLD, ["cf1", "cf2"]) == {"cf1": "", "cf2": ""}
    for service, request in fleet.calls[1:]:
        assert service.endswith("/high_level/go_to")
        assert request.relative
        assert (request.goal.x, request.goal.y, request.goal.z, request.yaw) == (0.0,) * 4
    # The move that was held does not count any more.
    assert fleet.command(Action.GO_TO, ["cf2"], goal=(2.0, 0.0, 1.0)) == {"cf2": ""}


def test_paths_of_a_dry_run_are_in_the_scene_until_the_page_with_control_removes_them(
    fleet, monkeypatch
):
    result, answer = DryRunResult(True, "", {"cf1": ((0.0, 0.0, 1.0),)}), Future()
    answer.set_result(result)
    monkeypatch.setattr("crazyflie_dashboard.missions.Missions.dry_run", lambda *_: answer)
    mission = Path("/square.py")
    assert fleet.dashboard.dry_run(fleet.page, mission, ("cf1",)).result(0) is result
    other = fleet.dashboard.pages.open(fleet.texts.append)
    for page, paths in ((other, result.paths), (fleet.page, {})):
        fleet.dashboard.forget_paths(page)
        fleet.process.advance(0.05)
        assert fleet.dashboard.scene().paths == paths


def test_lights_show_which_one_it_is_for_a_while(fleet):
    lights = []
    parameters = fleet.process.transport.parameters
    parameters |= {"/cf2/deck/bcColorLedBot": 1, "/cf2/colorLedBot/wrgb8888": 5.0}

    def update(request):
        lights.append([parameters[f"/cf2/{name}"] for name in request.params])
        return srv.UpdateParamsResponse()

    fleet.process.handle("/driver").advertise_service(
        "/cf2/update_params", srv.UpdateParams, update
    )
    services = {**fleet.graph.services, "/cf2/update_params": "/driver"}
    fleet.graph = Graph(fleet.graph.topics, fleet.graph.topics, services)
    fleet.process.advance(2.1)
    assert fleet.command(Action.IDENTIFY, ["cf2"]) == {"cf2": ""}
    assert lights == [[255, 0xFFFFFF]]
    fleet.process.advance(5.1)
    assert lights[1:] == [[0, 5.0]]


def test_without_a_master_a_move_is_refused_with_the_reason(fleet, monkeypatch):
    def ask(names):
        raise MasterError("the master does not answer: timed out")

    monkeypatch.setattr(fleet.master, "parameters", ask)
    fleet.fly(cf1=(0.0, 0.0, 1.0), cf2=(4.0, 0.0, 1.0), cf3=(2.0, 2.0, 1.0))
    with pytest.raises(RefusalError, match="the master does not answer: timed out"):
        fleet.command(Action.GO_TO, ["cf1"], goal=(2.0, 0.0, 1.0))
    assert fleet.calls == []
