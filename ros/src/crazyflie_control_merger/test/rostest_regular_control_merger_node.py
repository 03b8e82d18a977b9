"""The merger in a process of its own, on a real master."""

import pytest
import rospy

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PrioritizedControl,
    PrioritizedControlStamped,
)
from crazyflie_utils.testing.peer import exchange


def test_merges():
    regular = ControlStamped(control=Control(0.1, -0.2, 0.3, 9.0))
    regular.header.stamp = rospy.Time(12, 345)
    prioritized = PrioritizedControl(Control(-0.1, 0.2, 1.0, 13.0), 0.5)
    merged = exchange(
        {
            "/control/lqr": regular,
            "/control/prioritized": PrioritizedControlStamped(control=prioritized),
        },
        "/control/merged",
        ControlStamped,
        lambda message: message.control.thrust != 9.0,
    )
    assert merged.header.stamp == regular.header.stamp
    assert merged.control.roll == pytest.approx(0.0)
    assert merged.control.pitch == pytest.approx(0.0)
    assert merged.control.yaw_dot == pytest.approx(0.65)
    assert merged.control.thrust == pytest.approx(11.0)
