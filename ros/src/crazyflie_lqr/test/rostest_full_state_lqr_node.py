"""The controller in a process of its own, on a real master."""

import pytest
import rospy

from crazyflie_msgs.msg import ControlStamped, FullState, FullStateStamped
from crazyflie_utils.testing.peer import exchange


def test_answers_a_state():
    reference = FullStateStamped(state=FullState(z=1.0))
    state = FullStateStamped(state=FullState(x=0.3, z=1.0, pitch=0.1, yaw=0.1))
    state.header.stamp = rospy.Time(12, 345)
    control = exchange({"/ref": reference, "/state": state}, "/control/lqr", ControlStamped)
    assert control.header.stamp == state.header.stamp
    assert control.control.pitch == pytest.approx(-0.1 - 0.0442, rel=0.05)
    assert control.control.yaw_dot == pytest.approx(-0.3)
    assert control.control.thrust == pytest.approx(9.81)
