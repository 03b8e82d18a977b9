"""Messages of many vehicles, quickly made.

As copy and pickle make objects: the messages' own __init__ takes five times as long.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, MultiArrayLayout

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)


def state_message(header: Header, row: Sequence[float]) -> PositionVelocityYawStateStamped:
    """Return a state: x, y, z, x_dot, y_dot, z_dot in m and m/s, yaw in rad."""
    state = object.__new__(PositionVelocityYawState)
    state.x, state.y, state.z, state.x_dot, state.y_dot, state.z_dot, state.yaw = row
    message = object.__new__(PositionVelocityYawStateStamped)
    message.header, message.state = header, state
    return message


def control_message(header: Header, row: Sequence[float]) -> ControlStamped:
    """Return a control: roll and pitch in rad, yaw_dot in rad/s, thrust in m/s^2."""
    control = object.__new__(Control)
    control.roll, control.pitch, control.yaw_dot, control.thrust = row
    message = object.__new__(ControlStamped)
    message.header, message.control = header, control
    return message


def array_message(rows: NDArray[np.float64]) -> Float64MultiArray:
    """Return the states of n vehicles, shape (n, 7)."""
    n, size = rows.shape
    layout = MultiArrayLayout(
        [MultiArrayDimension("vehicle", n, n * size), MultiArrayDimension("state", size, size)], 0
    )
    return Float64MultiArray(layout, rows.ravel())
