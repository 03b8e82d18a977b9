"""The converter in a process of its own, on a real master."""

import math

import pytest
from geometry_msgs.msg import Twist

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.testing.peer import exchange


def test_converts():
    control = Control(roll=0.1, pitch=0.2, yaw_dot=0.3, thrust=9.81)
    twist = exchange(
        {"/control/final": ControlStamped(control=control)},
        "/crazyflie/cmd_vel",
        Twist,
    )
    assert twist.linear.x == pytest.approx(math.degrees(0.2))
    assert twist.linear.y == pytest.approx(math.degrees(0.1))
    assert twist.linear.z == pytest.approx(42000.0)
    assert twist.angular.z == pytest.approx(-math.degrees(0.3))
