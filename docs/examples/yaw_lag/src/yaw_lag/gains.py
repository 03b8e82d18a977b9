"""The model linearised at hover, and its gains.

``python3 -m yaw_lag.gains K.txt`` writes them to a file.
"""

import sys

import numpy as np

from crazyflie_lqr.design import Design, Weights, design_gains
from crazyflie_lqr.gain_file import save_matrix
from crazyflie_lqr.models import LinearModel, near_hover

TIME_CONSTANT = 0.15
"""How the yaw rate follows its command, s."""

Q = np.diag([0.16, 0.16, 16.0, 0.08, 0.08, 8.0, 4.0, 0.1])
R = np.eye(4)


def linear_model(time_constant: float = TIME_CONSTANT) -> LinearModel:
    """Return the near-hover model with the yaw rate as an eighth state."""
    seven = near_hover()
    yaw, yaw_dot = 6, 7
    A = np.zeros((8, 8))
    A[:7, :7] = seven.A
    A[yaw, yaw_dot] = 1.0
    A[yaw_dot, yaw_dot] = -1.0 / time_constant
    B = np.zeros((8, 4))
    B[:6] = seven.B[:6]
    B[yaw_dot, 2] = 1.0 / time_constant
    return LinearModel("yaw_lag", (*seven.states, "yaw_dot"), A, B)


def design() -> Design:
    """Return the gains of the example."""
    return design_gains(linear_model(), Weights(Q, R, np.zeros((8, 4))))


if __name__ == "__main__":
    save_matrix(sys.argv[1], design().K, f"States: {', '.join(linear_model().states)}")
