"""The node that leads vehicles along ways, and apart."""

import math

import pytest
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import Float64MultiArray, String

from crazyflie_driver.msg import Hover, Position
from crazyflie_driver.srv import GoToRequest, UploadTrajectoryRequest
from crazyflie_driver.trajectory_messages import to_message
from crazyflie_fleet import fleet_file
from crazyflie_fleet.high_level_node import HighLevelNode
from crazyflie_fleet.high_level_services import full_state_message
from crazyflie_fleet.references_node import ReferencesNode
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.vectors import to_tuple


def flight_status(state):
    return FlightStatus(state=getattr(FlightStatus, state))


class Flight:
    """Two vehicles, cf1 and cf2, 1 m apart along y."""

    def __init__(self, own=2, vectorized=None, has_yaw=True):
        self.process = FakeProcess()
        fleet = fleet_file.grid(2)
        node = ReferencesNode(fleet, fleet.names[:own], "world", vectorized)
        assert self.process.launch(node, "/fleet/references")
        self.vehicles = node.vehicles
        for vehicle in node.vehicles:
            name = f"/{vehicle.name}/high_level"
            assert self.process.launch(HighLevelNode(vehicle), name, {"reference/yaw": has_yaw})
        self.states = {}
        for name, y in (("cf1", 0.0), ("cf2", 1.0)):
            self.process.publish(f"/{name}/in_flight_flight_status", flight_status("FLYING"))
            if f"/{name}/state" in self.process.transport.subscribers:
                self.see(name, y)
        self.process.timers().add(0.05, self.repeat_states)

    def see(self, name, y, y_dot=0.0, yaw=0.0):
        self.states[name] = PositionVelocityYawState(y=y, z=1.0, y_dot=y_dot, yaw=yaw)
        self.repeat_states()

    def repeat_states(self):
        for name, state in self.states.items():
            self.process.publish(f"/{name}/state", PositionVelocityYawStateStamped(state=state))

    def silence(self, name):
        del self.states[name]

    def want(self, name, y):
        state = PositionVelocityState(y=y, z=1.0)
        message = PositionVelocityStateStamped(state=state)
        message.header.stamp = self.process.clock.stamp()
        self.process.publish(f"/{name}/ref", message)
        return message

    def go_to(self, name="cf1", goal=(0.0, 0.5, 1.0), seconds=2.0, yaw=0.0, relative=False):
        return self.process.call(
            f"/{name}/go_to",
            GoToRequest(0, relative, Point(*goal), yaw, rospy.Duration(seconds)),
        )

    def followed(self, name):
        return self.process.published(f"/{name}/ref_safe")

    @property
    def reference(self):
        """The last one of cf1."""
        return self.followed("cf1")[-1].state

    @property
    def waiting(self):
        """Names of the vehicles that are held."""
        return self.process.published("/fleet/waiting")[-1].data

    def hold(self):
        """Refer cf1 to a place too near to cf2, until it is held at y = 0.8 m."""
        self.want("cf1", 0.9)
        self.see("cf1", 0.8)
        self.process.advance(0.06)

    def hold_in_a_move(self):
        """Hold cf1 at y = 0.8 m, in a move to a place too near to cf2."""
        self.go_to(goal=(0.0, 0.9, 1.0), seconds=4.0)
        self.process.advance(2.6)
        assert self.reference.y_dot > 0.3
        self.see("cf1", 0.8)
        self.process.advance(0.06)
        assert self.waiting == "cf1"


@pytest.fixture
def flight():
    return Flight()


def test_references_pass_as_they_are(flight):
    wanted = flight.want("cf1", 0.3)
    (followed,) = flight.followed("cf1")
    assert followed.header == wanted.header
    assert to_tuple(followed.state) == (*to_tuple(wanted.state), 0.0)
    invalid = PositionVelocityStateStamped(state=PositionVelocityState(x=math.nan))
    flight.process.publish("/cf1/ref", invalid)
    assert math.isnan(flight.reference.x)


def test_the_first_value_is_published_as_others_may_have_an_old_one(flight):
    """The process before this one, which was killed, held a vehicle."""
    flight.process.advance(0.1)
    assert [each.data for each in flight.process.published("/fleet/waiting")] == [""]


def test_who_would_come_too_close_waits_where_it_is(flight):
    flight.hold()
    held = flight.followed("cf1")[-1]
    assert (held.state.y, held.state.y_dot) == (0.8, 0.0)
    flight.want("cf1", 0.95)
    assert flight.followed("cf1")[-1] is held
    assert flight.waiting == "cf1"
    assert flight.process.logged("warn") == [
        "/fleet/references: cf1 and cf2 are 0.20 m apart and must not come closer than 0.30 m: "
        "a vehicle whose reference approaches the other is held"
    ]


def test_who_is_flown_elsewhere_is_kept_apart_from():
    flight = Flight(own=1)
    flight.hold()
    assert flight.reference.y == 0.8
    assert flight.waiting == "cf1"
    assert "/cf2/go_to" not in flight.process.transport.services


def test_a_vehicle_in_flight_that_is_not_seen_any_more_is_reported(flight):
    flight.see("cf2", 1.0, y_dot=-1.0)
    flight.want("cf1", 0.3)
    flight.silence("cf2")
    flight.process.advance(0.4)
    assert flight.process.logged("warn") == []
    flight.process.advance(1.0)
    assert flight.process.logged("warn") == [
        "/fleet/references: cf2 is in flight, and no state of it has come for 0.5 s: its position "
        "is not known; the others keep apart from its last place, (0.00, 1.00, 1.00)"
    ]
    # They do, and do not take it for one that goes on with its last speed.
    flight.see("cf1", 0.4)
    flight.process.advance(0.1)
    assert flight.reference.y == 0.3
    flight.want("cf1", 0.95)
    flight.see("cf1", 0.75)
    flight.process.advance(0.1)
    assert flight.reference.y == 0.75


def test_a_vehicle_on_the_ground_may_be_silent(flight):
    flight.process.publish("/cf2/in_flight_flight_status", flight_status("ON_GROUND"))
    flight.silence("cf2")
    flight.process.advance(2.0)
    assert flight.process.logged("warn") == []


def test_a_way_begins_where_the_vehicle_was(flight):
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=2.0)
    flight.process.advance(1.0)
    flight.see("cf1", 0.1)
    flight.process.advance(0.02)
    assert flight.reference.y == pytest.approx(0.25, abs=0.02)


def test_a_vehicle_that_was_never_seen_is_reported():
    process = FakeProcess()
    assert process.launch(ReferencesNode(fleet_file.grid(1), ("cf1",), "world"), "/references")
    process.publish("/cf1/in_flight_flight_status", flight_status("TAKING_OFF"))
    process.advance(0.1)
    (text,) = process.logged("warn")
    assert text.startswith("/references: cf1 is in flight, and no state of it has come for")
    assert text.endswith("the others cannot keep apart from it")


def test_a_way_stands_still_while_its_vehicle_is_not_seen(flight):
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=3.0)
    flight.process.advance(0.5)
    flight.silence("cf1")
    flight.process.advance(3.0)
    before = flight.reference.y
    assert before < 0.3
    flight.see("cf1", before)
    flight.process.advance(0.02)
    assert flight.reference.y == pytest.approx(before, abs=0.02)


def test_states_of_many_come_in_one_message():
    _, second = fleet_file.grid(2).vehicles
    flight = Flight(vectorized={"/swarm/states": (second,)})
    flight.process.publish("/swarm/states", Float64MultiArray(data=[0.0, 1.5, 1.0, 0, 0, 0, 0]))
    flight.process.publish("/swarm/states", Float64MultiArray(data=[0.0] * 8))
    assert flight.process.logged("warn") == [
        "/fleet/references: ignoring 8 numbers as states of 1 vehicles"
    ]
    flight.go_to("cf2", goal=(0.0, 0.5, 0.0), relative=True)
    flight.process.advance(0.02)
    assert flight.followed("cf2")[-1].state.y == pytest.approx(1.5, abs=0.001)


def test_it_goes_on_when_there_is_room(flight):
    flight.hold()
    flight.see("cf2", 2.0)
    flight.process.advance(0.06)
    again = flight.followed("cf1")[-1]
    assert again.state.y == 0.9
    assert again.header.stamp > flight.followed("cf1")[0].header.stamp
    assert flight.waiting == ""


def test_a_way_back_is_open(flight):
    flight.hold()
    flight.want("cf1", 0.0)
    flight.process.advance(0.06)
    assert flight.reference.y == 0.0


def test_go_to(flight):
    flight.want("cf1", 0.0)
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=2.0)
    flight.process.advance(1.0)
    middle = flight.reference
    assert (middle.y, middle.z) == (pytest.approx(0.25, abs=0.01), 1.0)
    assert middle.y_dot == pytest.approx(0.5 / 2.0 * 35.0 / 16.0, abs=0.01)
    flight.process.advance(1.1)
    end = flight.reference
    assert (end.y, end.y_dot) == (pytest.approx(0.5), 0.0)
    assert len(flight.followed("cf1")) == pytest.approx(101, abs=1)


def test_a_move_goes_on_where_its_references_come_late(flight):
    # As when two threads work: /cf1/ref is received after the next reference was published.
    def move_and_follow():
        flight.go_to(goal=(0.0, 0.5, 1.0), seconds=2.0)
        vehicle = flight.vehicles[0]
        for height in (1.01, 1.02):
            vehicle.follow(at_rest((0.0, 0.0, height)))

    flight.process.executor.submit(move_and_follow)
    flight.process.advance(2.1)
    assert flight.reference.y == pytest.approx(0.5)


def test_a_way_in_a_move_begins_as_the_move_is(flight):
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=2.0)
    flight.process.advance(1.0)
    before = flight.reference
    flight.see("cf1", before.y)
    flight.go_to(goal=(0.3, 0.25, 1.0), seconds=3.0)
    flight.process.advance(0.02)
    after = flight.reference
    assert before.y_dot == pytest.approx(0.547, abs=0.01)
    assert after.y_dot == pytest.approx(before.y_dot, abs=0.01)
    assert after.y == pytest.approx(before.y + 0.02 * before.y_dot, abs=1e-3)
    for _ in range(10):
        flight.process.advance(0.3)
        flight.see("cf1", flight.reference.y)
    end = flight.reference
    assert (end.x, end.y) == (pytest.approx(0.3), pytest.approx(0.25))
    assert (end.x_dot, end.y_dot) == (0.0, 0.0)


def test_a_way_after_a_hold_begins_at_rest(flight):
    flight.hold_in_a_move()
    flight.go_to(goal=(0.0, 0.0, 1.0), seconds=2.0)
    flight.process.advance(0.12)
    assert flight.waiting == ""
    assert abs(flight.reference.y_dot) < 0.05


def test_a_move_that_was_held_goes_on_at_rest_from_the_place_where_it_was_held(flight):
    flight.hold_in_a_move()
    before = len(flight.followed("cf1"))
    flight.see("cf2", 3.0)
    flight.process.advance(3.0)
    assert flight.waiting == ""
    # References that went on where they had stopped, at their speed, would pull it with a jerk.
    references = [each.state for each in flight.followed("cf1")[before:]]
    assert (references[0].y, references[0].y_dot) == (0.8, 0.0)
    assert min(each.y for each in references) == 0.8
    assert max(each.y_dot for each in references) < 0.2
    assert references[-1].y == pytest.approx(0.9)


def test_a_way_back_is_open_also_for_a_vehicle_that_has_not_come_to_rest(flight):
    flight.hold_in_a_move()
    # It overshoots the place where it is held, and then rests a little behind it.
    flight.see("cf1", 0.82)
    before = len(flight.followed("cf1"))
    flight.go_to(goal=(0.0, 0.0, 1.0), seconds=4.0)
    flight.see("cf1", 0.79)
    flight.process.advance(5.0)
    assert flight.waiting == ""
    references = [each.state.y for each in flight.followed("cf1")[before:]]
    # The way back begins at the place where it is held, not nearer to the other vehicle.
    assert max(references) <= 0.8
    assert references[-1] == pytest.approx(0.0)


def test_setpoints_after_a_move_are_followed_again_after_a_hold(flight):
    flight.go_to(goal=(0.0, 0.1, 1.0), seconds=1.0)
    flight.process.advance(1.1)
    flight.see("cf1", 0.8)
    for _ in range(5):
        flight.process.publish("/cf1/high_level/cmd_position", Position(y=0.9, z=1.0))
        flight.process.advance(0.1)
    assert flight.waiting == "cf1"
    flight.see("cf2", 3.0)
    flight.process.publish("/cf1/high_level/cmd_position", Position(y=0.9, z=1.0))
    flight.process.advance(0.1)
    assert flight.waiting == ""
    assert flight.reference.y == pytest.approx(0.9)
    assert flight.process.logged("error") == []


def test_a_refused_command_during_a_hold_changes_nothing(flight):
    flight.hold_in_a_move()
    with pytest.raises(ServiceError, match="one of the numbers is nan"):
        flight.go_to(goal=(math.nan, 0.0, 1.0))
    flight.see("cf2", 3.0)
    flight.process.advance(3.0)
    assert flight.reference.y == pytest.approx(0.9)


def test_a_way_of_a_vehicle_that_is_elsewhere_begins_with_its_velocity(flight):
    flight.want("cf1", 0.0)
    flight.see("cf1", -0.5, y_dot=0.4)
    flight.go_to(goal=(0.0, -0.5, 1.0), seconds=3.0)
    flight.process.advance(0.02)
    assert flight.reference.y_dot == pytest.approx(0.4, abs=0.01)


def test_a_way_that_cannot_be_braked_for_is_refused(flight):
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=2.0)
    flight.process.advance(1.0)
    flight.see("cf1", 0.25)
    with pytest.raises(
        ServiceError, match=r"0.25 m in 0.5 s; expected a duration of at least 2\.15"
    ):
        flight.go_to(goal=(0.0, 0.0, 1.0), seconds=0.5)


def test_go_to_relative_and_another_reference_ends_it(flight):
    flight.go_to("cf2", goal=(0.0, 0.5, 0.0), relative=True)
    flight.process.advance(0.5)
    assert 1.0 < flight.followed("cf2")[-1].state.y < 1.5
    flight.want("cf2", 1.2)
    count = len(flight.followed("cf2"))
    flight.process.advance(0.5)
    assert flight.followed("cf2")[-1].state.y == 1.2
    assert len(flight.followed("cf2")) == count


def test_a_landing_ends_a_way(flight):
    flight.go_to()
    flight.process.advance(0.1)
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("DESCENDING"))
    count = len(flight.followed("cf1"))
    flight.process.advance(1.0)
    assert len(flight.followed("cf1")) == count


def test_a_vehicle_that_the_fleet_lands_starts_no_trajectory(flight):
    piece = to_message(smooth_piece(at_rest((0.0, 0.0, 1.0)), (0.0, 0.5, 1.0), 0.0, 2.0))
    upload = UploadTrajectoryRequest(0, 0, [piece])
    flight.process.call("/cf1/high_level/upload_trajectory", upload)
    flight.process.publish("/fleet/landing", String("cf1"))
    flight.process.publish("/all/start_trajectory", String("/cf1/high_level"))
    flight.process.advance(1.0)
    assert flight.reference.y == 0.0
    assert flight.process.logged("error") == [
        "/cf1/high_level: not done: the fleet is landing the vehicle; it takes no commands"
    ]


def test_a_vehicle_that_the_fleet_lands_forgets_what_was_to_follow_its_takeoff(flight):
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("TAKING_OFF"))
    flight.process.call(
        "/cf1/high_level/go_to", GoToRequest(0, False, Point(0, 0.5, 1), 0.0, rospy.Duration(2))
    )
    flight.process.publish("/fleet/landing", String("cf1"))
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("FLYING"))
    flight.process.advance(1.0)
    assert flight.followed("cf1") == []


def test_go_to_is_refused(flight):
    with pytest.raises(ServiceError, match=r"/cf1/go_to refused: 0.50 m in 0.1 s; expected a dur"):
        flight.go_to(seconds=0.1)
    with pytest.raises(ServiceError, match="/cf1/go_to refused: one of the numbers is nan"):
        flight.go_to(goal=(math.nan, 0.0, 1.0))
    flight.silence("cf1")
    flight.process.advance(0.6)
    with pytest.raises(ServiceError, match="/cf1/go_to refused: no state has come on /cf1/state"):
        flight.go_to()
    flight.process.publish("/cf2/in_flight_flight_status", flight_status("ON_GROUND"))
    flight.see("cf2", 1.0)
    with pytest.raises(ServiceError, match="/cf2/go_to refused: the vehicle is on the ground"):
        flight.go_to("cf2")


def test_references_without_a_heading_keep_it_and_moves_turn(flight):
    flight.see("cf1", 0.0, yaw=0.5)
    flight.want("cf1", 0.1)
    assert flight.reference.yaw == 0.5
    # Not what is measured a moment later.
    flight.see("cf1", 0.0, yaw=0.6)
    flight.want("cf1", 0.0)
    assert flight.reference.yaw == 0.5
    flight.go_to(goal=(0.0, 0.3, 1.0), seconds=2.0, yaw=-0.5)
    flight.process.advance(1.0)
    assert flight.reference.yaw == pytest.approx(0.0, abs=0.02)
    flight.process.advance(1.1)
    assert flight.reference.yaw == pytest.approx(-0.5)
    flight.go_to(goal=(0.0, 0.0, 1.0), seconds=2.0, yaw=math.nan)
    flight.process.advance(2.1)
    assert flight.reference.yaw == pytest.approx(-0.5)
    flight.want("cf1", 0.1)
    assert flight.reference.yaw == pytest.approx(-0.5)
    # The next flight keeps the heading that the vehicle has then.
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("ON_GROUND"))
    flight.see("cf1", 0.0, yaw=1.0)
    flight.process.advance(0.1)
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("TAKING_OFF"))
    flight.want("cf1", 0.0)
    assert flight.reference.yaw == 1.0


def test_a_vehicle_whose_model_has_no_yaw_refuses_one():
    flight = Flight(has_yaw=False)
    with pytest.raises(ServiceError, match="yaw is 1 rad, and the controller keeps the heading 0"):
        flight.go_to(yaw=1.0)
    flight.go_to(yaw=math.nan)


def test_a_vehicle_whose_model_has_no_yaw_keeps_its_heading_by_setpoints():
    flight = Flight(has_yaw=False)
    for setpoint in (
        full_state_message(Goal((0.0, 0.1, 1.0), (0.0,) * 3, (0.0,) * 3, 0.5, 0.5)),
        Position(y=0.2, z=1.0, yaw=30.0),
        Hover(yawrate=20.0, zDistance=1.0),
    ):
        name = type(setpoint).__name__
        topic = {"FullState": "full_state"}.get(name, name.lower())
        flight.process.publish(f"/cf1/high_level/cmd_{topic}", setpoint)
        assert flight.reference.yaw == 0.0
    assert len(flight.followed("cf1")) == 3


def test_both_services_fly_the_same_move():
    flown = []
    for service in ("go_to", "high_level/go_to"):
        flight = Flight()
        flight.go_to(goal=(0.0, 0.5, 1.0), seconds=4.0, yaw=0.4)
        flight.process.advance(1.5)
        flight.see("cf1", flight.reference.y)
        # In the move, back: it brakes first.
        request = GoToRequest(0, False, Point(0.0, -0.5, 1.0), -0.4, rospy.Duration(6.0))
        flight.process.call(f"/cf1/{service}", request)
        for _ in range(31):
            flight.process.advance(0.2)
            flight.see("cf1", flight.reference.y)
        flown.append([to_tuple(each.state) for each in flight.followed("cf1")])
    assert flown[0] == flown[1]
    assert flown[0][-1] == pytest.approx((0.0, -0.5, 1.0, 0.0, 0.0, 0.0, -0.4))


def test_a_move_by_which_the_fleet_lands_a_vehicle_follows_its_takeoff(flight):
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("TAKING_OFF"))
    flight.process.publish("/fleet/landing", String("cf1"))
    flight.go_to(goal=(0.0, 0.5, 1.0), seconds=3.0)
    flight.process.publish("/cf1/in_flight_flight_status", flight_status("FLYING"))
    flight.process.advance(3.5)
    assert flight.reference.y == pytest.approx(0.5)
    assert flight.process.logged("error") == []
