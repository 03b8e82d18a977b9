"""What the step responses in the picture show."""

import math

import numpy as np
import pytest

from crazyflie_lqr.design import Weights, design_gains
from crazyflie_lqr.design_plot import step_responses
from crazyflie_lqr.models import near_hover

MODEL = near_hover()
WEIGHTS = Weights(np.diag([1.0, 1, 1, 1, 1, 1, 4]), np.eye(4), np.zeros((7, 4)))


def test_yaw_approaches_its_reference_exponentially():
    time, states, controls = step_responses(MODEL, design_gains(MODEL, WEIGHTS))
    np.testing.assert_allclose(states["yaw"], 1.0 - np.exp(-2.0 * time), atol=1e-6)
    np.testing.assert_allclose(controls["yaw"], 2.0 * np.exp(-2.0 * time), atol=1e-6)


@pytest.mark.parametrize("times", [(0.0, 0.0), (0.02, 0.05)])
def test_every_output_reaches_its_reference(times):
    _, states, controls = step_responses(MODEL, design_gains(MODEL, WEIGHTS, *times))
    for output in ("x", "y", "z", "yaw"):
        assert states[output][0] == pytest.approx(0.0)
        assert states[output][-1] == pytest.approx(1.0, abs=0.01)
        assert controls[output][-1] == pytest.approx(0.0, abs=0.01)
    assert controls["x"][0] > 0.0 > controls["y"][0]
    assert math.isclose(controls["x"][0], -controls["y"][0])
