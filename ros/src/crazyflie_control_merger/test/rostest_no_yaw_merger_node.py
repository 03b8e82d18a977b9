"""The merger in a process of its own, on a real master."""

import pytest

from crazyflie_msgs.msg import Control, ControlStamped, NoYawControl, NoYawControlStamped
from crazyflie_utils.testing.peer import exchange


def test_merges_all_but_the_yaw_rate():
    prioritized = NoYawControl(roll=-0.1, pitch=0.2, thrust=13.0, priority=1.0)
    merged = exchange(
        {
            "/control/lqr": ControlStamped(control=Control(0.1, -0.2, 0.3, 9.0)),
            "/control/prioritized": NoYawControlStamped(control=prioritized),
        },
        "/control/merged",
        ControlStamped,
        lambda message: message.control.thrust != 9.0,
    )
    assert merged.control == Control(-0.1, 0.2, pytest.approx(0.3), 13.0)
