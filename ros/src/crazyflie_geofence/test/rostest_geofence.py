"""The fence and the merger in processes of their own, on a real master."""

import pytest

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing.peer import exchange

REGULAR = Control(roll=0.0, pitch=0.1, yaw_dot=0.3, thrust=9.81)


@pytest.mark.parametrize(
    ("x", "is_right"),
    [
        pytest.param(0.0, lambda control: control == REGULAR, id="in the middle"),
        pytest.param(2.0, lambda control: control.pitch < 0.0, id="too far in front"),
        pytest.param(-2.0, lambda control: control.pitch > 0.11, id="too far behind"),
    ],
)
def test_a_vehicle_is_left_alone_or_brought_back(x, is_right):
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=x, z=1.0))
    # The merger may answer a control with what the fence has said of the last vehicle.
    answer = exchange(
        {"/state": state, "/control/lqr": ControlStamped(control=REGULAR)},
        "/control/merged",
        ControlStamped,
        lambda message: is_right(message.control),
    )
    assert is_right(answer.control)
