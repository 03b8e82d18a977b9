"""Setpoints of the driver for a vehicle under the workspace's controller, on a fake process."""

import math

import pytest
from geometry_msgs.msg import Vector3
from high_level_bench import TOP, Bench
from std_msgs.msg import Empty

from crazyflie_driver import srv
from crazyflie_driver.msg import Hover, Position, VelocityWorld
from crazyflie_driver.trajectory_messages import to_message
from crazyflie_fleet.high_level_services import full_state_message, setpoint_of
from crazyflie_model.planner import smooth_piece
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_utils import ServiceError


@pytest.fixture
def bench():
    """Return a vehicle that flies at (0, 0, 1)."""
    made = Bench()
    made.be("flying")
    return made


def test_a_full_state_has_the_heading_of_its_goal():
    # A quarter turn to the left: the quaternion's z and w are sin(45 degrees).
    message = full_state_message(at_rest((0.5, 0.0, 1.0), math.pi / 2.0))
    q = message.pose.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.0, 0.0, 0.7071068, 0.7071068))
    assert setpoint_of(message).yaw == pytest.approx(1.5707963)


def test_setpoints_are_followed_until_they_stop(bench):
    goal = Goal((0.5, 0.0, 1.0), (0.2, 0.0, 0.0), (0.0, 0.0, 0.0), 0.3, 0.0)
    assert setpoint_of(full_state_message(goal)).yaw == pytest.approx(0.3)
    bench.process.publish(f"{TOP}/cmd_full_state", full_state_message(goal))
    assert bench.references()[-1] == pytest.approx([0.5, 0.0, 1.0, 0.2, 0.0, 0.0])
    bench.see((0.5, 0.0, 1.0))
    assert bench.fly(1.2)[-1] == pytest.approx([0.5, 0.0, 1.0, 0.0, 0.0, 0.0])
    for x in (0.4, math.nan):
        bench.process.publish(f"{TOP}/cmd_position", Position(x=x, z=1.0))
    assert bench.references()[-1] == pytest.approx([0.4, 0.0, 1.0, 0.0, 0.0, 0.0], abs=1e-6)


def test_setpoints_that_stop_together_with_the_states_leave_a_reference_at_rest(bench):
    goal = Goal((0.5, 0.0, 1.0), (0.2, 0.0, 0.0), (0.0, 0.0, 0.0), 0.3, 0.0)
    bench.process.publish(f"{TOP}/cmd_full_state", full_state_message(goal))
    bench.process.advance(1.2)
    assert bench.references()[-1] == pytest.approx([0.5, 0.0, 1.0, 0.0, 0.0, 0.0])


def test_a_velocity_moves_the_goal_on(bench):
    setpoint = VelocityWorld(vel=Vector3(0.5, 0.0, -0.1))
    for _ in range(11):
        bench.process.publish(f"{TOP}/cmd_velocity_world", setpoint)
        bench.process.advance(0.1)
        bench.see(bench.references()[-1][:3])
    assert bench.references()[-1] == pytest.approx([0.5, 0.0, 0.9, 0.5, 0.0, -0.1])
    bench.process.publish(f"{TOP}/cmd_hover", Hover(vx=0.0, vy=0.2, zDistance=0.7))
    assert bench.references()[-1] == pytest.approx([0.55, 0.0, 0.7, 0.0, 0.2, 0.0])
    # Then it stays where it is.
    assert bench.fly(1.2)[-1] == pytest.approx([0.55, 0.0, 0.7, 0.0, 0.0, 0.0])


def test_what_the_controller_cannot_do_is_reported(bench):
    bench.process.publish(f"{TOP}/cmd_hover", Hover(vx=0.1, yawrate=20.0, zDistance=1.0))
    bench.process.publish(f"{TOP}/cmd_stop", Empty())
    assert bench.process.logged("warn") == [
        f"{TOP}: the controller keeps the heading 0: yaw and yaw rate of setpoints are ignored",
        f"{TOP}: ignoring cmd_stop: a vehicle in flight would fall",
    ]
    piece = smooth_piece(at_rest((0.0, 0.0, 1.0), 0.0), (0.0, 0.0, 1.0), 1.0, 2.0)
    with pytest.raises(ServiceError, match="trajectory 3 has a yaw, and the controller keeps"):
        bench.call("upload_trajectory", srv.UploadTrajectory, 3, 0, [to_message(piece)])


def test_a_setpoint_ends_a_way(bench):
    bench.go_to((1.0, 0.0, 1.0))
    bench.fly(0.5)
    bench.process.publish(f"{TOP}/cmd_position", Position(x=0.1, z=1.0))
    bench.process.advance(0.3)
    assert bench.references()[-1][0] == pytest.approx(0.1)
    bench.node.shutdown()
    assert bench.references()[-1] == pytest.approx([0.1, 0.0, 1.0, 0.0, 0.0, 0.0])
