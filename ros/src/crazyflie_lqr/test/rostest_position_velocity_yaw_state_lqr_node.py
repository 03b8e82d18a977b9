"""The controller in a process of its own, on a real master."""

import pytest
import rospy

from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing.peer import exchange


def test_answers_a_state():
    reference = PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=1.0, yaw=0.3))
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=0.01, z=1.0, yaw=0.2))
    state.header.stamp = rospy.Time(12, 345)
    control = exchange({"/ref": reference, "/state": state}, "/control/lqr", ControlStamped)
    assert control.header.stamp == state.header.stamp
    assert control.control.yaw_dot == pytest.approx(0.8)
    assert control.control.pitch == pytest.approx(-0.025, rel=0.05)
