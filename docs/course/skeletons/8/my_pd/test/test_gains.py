"""Step 5: the gains of config/K.txt, designed by LQR: a step that tilts the vehicle little."""

from pathlib import Path

import numpy as np
import pytest

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.linear_feedback import LinearFeedback
from my_pd.simulation import TIME_STEP, fly

FILE = Path(__file__).resolve().parents[1] / "config" / "K.txt"
HOVER = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
SIZE = 0.5
"""Of the step, m."""


@pytest.mark.parametrize("axis", [0, 1])
def test_step_5_a_step_of_half_a_metre_tilts_by_less_than_10_degrees(axis):
    control = LinearFeedback(load_matrix(str(FILE), 4, 7), (0.0, 0.0, 0.0, 9.81), 6).control
    goal = HOVER.copy()
    goal[axis] += SIZE
    states, controls = fly(control, lambda time: goal, 8.0, HOVER)
    share = states[:, axis] / SIZE
    times = TIME_STEP * np.arange(len(share))
    assert np.degrees(np.abs(controls[:, :2]).max()) < 10.0
    assert share.max() < 1.1
    assert np.abs(share[times > 4.0] - 1.0).max() < 0.05
