"""The fence and the merger in processes of their own, on a real master."""

import rospy

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing.peer import exchange

REGULAR = Control(roll=0.0, pitch=0.2, yaw_dot=0.3, thrust=9.81)


def merged_at(x):
    """Return what becomes of the regular control of a vehicle at rest at (x, 0, 1)."""
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=x, z=1.0))
    state.header.stamp = rospy.Time(12, 345)
    regular = ControlStamped(state.header, REGULAR)
    return exchange(
        {"/state": state, "/control/lqr": regular},
        "/control/merged",
        ControlStamped,
        lambda message: (message.control == REGULAR) == (x == 0.0),
    )


def test_leaves_a_vehicle_in_the_middle_alone():
    assert merged_at(0.0).control == REGULAR


def test_brings_back_a_vehicle_that_is_outside():
    assert merged_at(2.0).control.pitch < 0.0
    assert merged_at(-2.0).control.pitch > 0.2
