"""The driver's services for a vehicle under the workspace's controller, on a fake process."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Point
from high_level_bench import SECONDS, TOP, Bench
from std_msgs.msg import String
from visualization_msgs.msg import Marker

from crazyflie_driver import srv
from crazyflie_driver.trajectory_messages import to_message
from crazyflie_fleet.high_level_services import full_state_message
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
)
from crazyflie_utils import ServiceError


def pieces_through(*points):
    """Return pieces of 1 s from rest to rest."""
    return [
        smooth_piece(at_rest(start, 0.0), end, 0.0, 1.0)
        for start, end in zip(points, points[1:], strict=False)
    ]


@pytest.fixture
def bench():
    """Return a vehicle that flies at (0, 0, 1)."""
    made = Bench(**{"frames/fixed": "hall"})
    made.be("flying")
    return made


def test_goes_where_it_is_told_and_falls_silent(bench):
    bench.go_to((1.0, 0.0, 1.5))
    references = bench.fly(3.0)
    assert references[0] == pytest.approx([0.0, 0.0, 1.0, 0.0, 0.0, 0.0], abs=1e-3)
    assert references[-1] == pytest.approx([1.0, 0.0, 1.5, 0.0, 0.0, 0.0])
    assert references[:, 3].max() == pytest.approx(35.0 / 16.0 / 2.0, rel=0.01)
    assert len(references) == pytest.approx(101, abs=2)
    bench.go_to((0.5, 0.0, 0.0), relative=True)
    assert bench.fly(2.1)[-1][:3] == pytest.approx([1.5, 0.0, 1.5])


def test_a_new_way_begins_as_the_old_one_is(bench):
    bench.go_to((1.0, 0.0, 1.0))
    before = bench.fly(1.0)[-1]
    bench.go_to((0.0, 1.0, 1.0))
    bench.process.advance(0.02)
    after = bench.references()[-1]
    assert after[3] == pytest.approx(before[3], abs=0.1)
    assert bench.fly(2.1)[-1][:3] == pytest.approx([0.0, 1.0, 1.0])


def test_somebody_else_has_moved_it(bench):
    bench.go_to((1.0, 0.0, 1.0))
    bench.fly(2.2)
    bench.see((-1.0, 0.0, 1.0))
    bench.go_to((-1.0, 0.0, 1.2))
    bench.process.advance(0.02)
    assert bench.references()[-1][0] == pytest.approx(-1.0)


def test_a_move_of_a_vehicle_that_was_moved_elsewhere_begins_with_its_velocity(bench):
    bench.go_to((1.0, 0.0, 1.0))
    bench.fly(2.2)
    bench.see((-1.0, 0.0, 1.0), (0.0, 0.5, 0.0))
    bench.go_to((-1.0, 1.0, 1.0))
    bench.process.advance(0.02)
    assert bench.references()[-1][4] == pytest.approx(0.5, abs=0.02)


def test_a_move_after_setpoints_begins_where_they_were(bench):
    # The path flown before them is ignored, although it is near.
    bench.go_to((0.0, 0.0, 1.0), duration=0.1)
    bench.fly(0.2)
    goal = Goal((0.3, 0.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0)
    bench.process.publish(f"{TOP}/cmd_full_state", full_state_message(goal))
    bench.see((0.25, 0.0, 1.0))
    bench.go_to((1.0, 0.0, 1.0))
    bench.process.advance(0.02)
    assert bench.references()[-1] == pytest.approx([0.31, 0.0, 1.0, 0.5, 0.0, 0.0], abs=0.005)


def test_what_is_flown_is_shown_until_its_end(bench):
    def plans():
        return [m.markers[0] for m in bench.process.published(f"{TOP}/plan/markers")]

    bench.go_to((1.0, 0.0, 1.5))
    bench.fly(1.0)
    (plan,) = plans()
    assert (plan.action, plan.header.frame_id) == (Marker.ADD, "hall")
    points = np.array([(p.x, p.y, p.z) for p in plan.points])
    assert points[[0, 10, -1]] == pytest.approx(
        np.array([(0.0, 0.0, 1.0), (0.5, 0.0, 1.25), (1.0, 0.0, 1.5)])
    )
    bench.go_to((0.0, 0.0, 1.0))
    bench.fly(1.9)
    assert [plan.action for plan in plans()] == [Marker.ADD, Marker.ADD]
    bench.fly(0.2)
    assert [plan.action for plan in plans()] == [Marker.ADD, Marker.ADD, Marker.DELETE]


def test_what_is_not_flown_any_more_is_not_shown(bench):
    bench.go_to((1.0, 0.0, 1.5))
    bench.be("landing")
    (_, last) = bench.process.published(f"{TOP}/plan/markers")
    assert last.markers[0].action == Marker.DELETE


def test_trajectories_are_uploaded_and_flown(bench):
    pieces = pieces_through((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 1.0))
    bench.call("upload_trajectory", srv.UploadTrajectory, 3, 0, [to_message(p) for p in pieces])
    bench.call("start_trajectory", srv.StartTrajectory, 0, 3, 0.5, False, False)
    duration = 0.5 * sum(piece.duration for piece in pieces)
    references = bench.fly(duration + 0.2)
    assert references[-1][:3] == pytest.approx([1.0, 1.0, 1.0], abs=1e-5)
    nearest = np.linalg.norm(references[:, :3] - [1.0, 0.0, 1.0], axis=1).min()
    assert nearest < 0.02


def test_takes_off_by_the_takeoff_server_and_then_climbs():
    bench = Bench()
    bench.be("on_ground", (0.3, 0.0, 0.0))
    bench.call("takeoff", srv.Takeoff, 0, 0.6, SECONDS(2.0))
    assert bench.called == ["takeoff"]
    bench.be("taking_off", (0.3, 0.0, 0.1))
    assert bench.fly(1.0).size == 0
    bench.be("flying", (0.3, 0.0, 1.0))
    assert bench.fly(2.1)[-1][:3] == pytest.approx([0.3, 0.0, 0.6])


def test_what_is_told_during_a_takeoff_counts_after_it():
    bench = Bench()
    bench.be("on_ground", (0.0, 0.0, 0.0))
    bench.call("takeoff", srv.Takeoff, 0, 0.6, SECONDS(2.0))
    bench.be("taking_off", (0.0, 0.0, 0.1))
    bench.go_to((1.0, 0.0, 1.0))
    bench.be("flying")
    assert bench.fly(2.1)[-1][:3] == pytest.approx([1.0, 0.0, 1.0])


def test_what_cannot_be_done_is_refused_during_a_takeoff_at_once():
    bench = Bench()
    bench.be("taking_off", (0.0, 0.0, 0.1))
    with pytest.raises(ServiceError, match="no trajectory 1 was uploaded"):
        bench.call("start_trajectory", srv.StartTrajectory, 0, 1, 1.0, False, False)
    with pytest.raises(ServiceError, match="the duration is 0 s"):
        bench.call("go_to", srv.GoTo, 0, False, Point(1.0, 0.0, 1.0), 0.0, SECONDS(0.0))
    bench.be("flying")
    assert bench.fly(0.5).size == 0


@pytest.mark.parametrize("how", ["by this node", "by the takeoff server"])
def test_a_command_does_not_survive_an_aborted_takeoff(how):
    bench = Bench()
    bench.be("on_ground", (0.0, 0.0, 0.0))
    if how == "by this node":
        bench.call("takeoff", srv.Takeoff, 0, 0.6, SECONDS(2.0))
    bench.be("taking_off", (0.0, 0.0, 0.1))
    bench.go_to((1.0, 0.0, 1.0))
    bench.be("landing", (0.0, 0.0, 0.1))
    bench.be("on_ground", (0.0, 0.0, 0.0))
    bench.be("taking_off", (0.0, 0.0, 0.1))
    bench.be("flying")
    assert bench.fly(2.1).size == 0


def test_the_height_of_a_takeoff_outlives_what_was_said_of_the_ground():
    bench = Bench()
    bench.be("on_ground", (0.0, 0.0, 0.0))
    bench.call("takeoff", srv.Takeoff, 0, 0.6, SECONDS(2.0))
    bench.be("on_ground", (0.0, 0.0, 0.0))
    bench.be("taking_off", (0.0, 0.0, 0.1))
    bench.be("flying")
    assert bench.fly(2.1)[-1][:3] == pytest.approx([0.0, 0.0, 0.6])


def test_is_silent_while_the_vehicle_lands(bench):
    bench.go_to((1.0, 0.0, 1.0))
    bench.fly(1.0)
    bench.call("land", srv.Land, 0, 0.0, SECONDS(2.0))
    bench.be("descending")
    count = len(bench.references())
    bench.process.advance(1.0)
    assert bench.called == ["land"]
    assert len(bench.references()) == count


def test_references_have_a_heading_for_controllers_that_follow_it():
    bench = Bench(**{"reference/yaw": True})
    bench.be("flying")
    bench.go_to((0.0, 0.0, 1.0), yaw=0.5)
    assert bench.fly(2.1)[-1][6] == pytest.approx(0.5)


def test_ends_at_rest(bench):
    bench.go_to((1.0, 0.0, 1.0))
    assert bench.fly(1.0)[-1][3] > 0.5
    bench.node.shutdown()
    assert bench.references()[-1][3:] == pytest.approx([0.0, 0.0, 0.0])
    assert bench.references()[-1][0] == pytest.approx(0.5, abs=0.02)


REFUSED = {
    "no state has come on /cf1/state": lambda b: (b.process.advance(1.0), b.go_to((1, 0, 1))),
    "yaw is 0.5 rad, and the controller keeps the heading 0": lambda b: b.go_to((1, 0, 1), 0.5),
    "one of the numbers is nan": lambda b: b.go_to((math.nan, 0, 1)),
    "the duration is 0 s; expected more": lambda b: b.go_to((1, 0, 1), duration=0.0),
    "no trajectory 7 was uploaded": lambda b: b.call(
        "start_trajectory", srv.StartTrajectory, 0, 7, 1.0, False, False
    ),
    "has no pieces": lambda b: b.call("upload_trajectory", srv.UploadTrajectory, 0, 0, []),
    "height and duration are 0 m": lambda b: b.call("takeoff", srv.Takeoff, 0, 0.0, SECONDS(1.0)),
    "the vehicle is flying; expected it to have landed": lambda b: b.call("stop", srv.Stop, 0),
    "the vehicle is on the ground; expected it to fly": lambda b: (
        b.be("on_ground"),
        b.go_to((1, 0, 1)),
    ),
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_makes_no_sense_is_refused(bench, text):
    with pytest.raises(ServiceError, match=text):
        REFUSED[text](bench)
    bench.process.advance(0.1)
    assert bench.references() == []


def test_who_is_named_begins_what_was_uploaded(bench):
    pieces = [to_message(p) for p in pieces_through((0.0, 0.0, 1.0), (0.5, 0.0, 1.0))]
    bench.be("flying")
    bench.call("upload_trajectory", srv.UploadTrajectory, 0, 0, pieces)
    bench.process.publish("/all/start_trajectory", String("/cf2/high_level /cf11/high_level"))
    assert len(bench.fly(0.5)) == 0
    bench.see((0.0, 0.0, 1.0))
    bench.process.publish("/all/start_trajectory", String(f"/cf2/high_level {TOP}"))
    assert bench.fly(5.0)[-1] == pytest.approx([0.5, 0, 1, 0, 0, 0], abs=0.01)


def test_who_does_not_fly_does_not_begin(bench):
    bench.be("on_ground", (0.0, 0.0, 0.0))
    bench.process.publish("/all/start_trajectory", String(TOP))
    assert len(bench.fly(0.5)) == 0
    assert bench.process.logged("error") == [f"{TOP}: not started: the vehicle is on the ground"]


def test_the_servers_hover_point_is_replaced_by_one_above_the_vehicle(bench):
    bench.be("on_ground", (2.0, 0.0, 0.1))
    bench.call("takeoff", srv.Takeoff, 0, 0.5, SECONDS(2.0))
    # A status of which something else than the state has changed.
    bench.be("on_ground", (2.0, 0.0, 0.1))
    bench.be("taking_off", (2.0, 0.0, 0.1))
    bench.process.advance(1.0)
    # Nothing before the server has handed over: the controller takes it for the takeoff.
    assert bench.references() == []
    hover = PositionVelocityStateStamped(state=PositionVelocityState(x=0.0, y=0.0, z=1.0))
    bench.process.publish("/cf1/ref", hover)
    assert bench.references() == [pytest.approx([2.0, 0.0, 0.5, 0.0, 0.0, 0.0])]
    bench.process.publish("/cf1/ref", bench.process.published("/cf1/ref")[-1])
    assert len(bench.references()) == 1


def test_takeoffs_of_others_go_where_their_server_says(bench):
    bench.be("taking_off", (2.0, 0.0, 0.1))
    hover = PositionVelocityStateStamped(state=PositionVelocityState(x=0.0, y=0.0, z=1.0))
    bench.process.publish("/cf1/ref", hover)
    assert bench.references() == []


def test_a_takeoff_to_below_the_vehicle_is_refused(bench):
    bench.be("on_ground", (0.0, 0.0, 0.7))
    with pytest.raises(
        ServiceError, match="height is 0.5 m, and the vehicle is at 0.70 m; expected"
    ):
        bench.call("takeoff", srv.Takeoff, 0, 0.5, SECONDS(2.0))
