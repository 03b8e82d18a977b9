"""The controller in a process of its own, on a real master."""

import pytest
import rospy
from asking import ask

from crazyflie_msgs.msg import PositionVelocityYawState, PositionVelocityYawStateStamped


def test_answers_a_state():
    reference = PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=1.0, yaw=0.3))
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=0.01, z=1.0, yaw=0.2))
    state.header.stamp = rospy.Time(12, 345)
    control = ask(reference, state)
    assert control.header.stamp == state.header.stamp
    assert control.control.yaw_dot == pytest.approx(10.0)
    assert control.control.pitch == pytest.approx(-0.1, rel=0.05)
