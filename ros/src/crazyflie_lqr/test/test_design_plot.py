"""The step responses in the picture."""

import math

import numpy as np
import pytest
from matplotlib.figure import Figure

from crazyflie_lqr.design import Design, Weights, design_gains
from crazyflie_lqr.design_plot import _draw_bode, step_responses
from crazyflie_lqr.models import near_hover

MODEL = near_hover()
WEIGHTS = Weights(np.diag([1.0, 1, 1, 1, 1, 1, 4]), np.eye(4), np.zeros((7, 4)))


def test_yaw_approaches_its_reference_exponentially():
    time, states, controls = step_responses(MODEL, design_gains(MODEL, WEIGHTS))
    np.testing.assert_allclose(states["yaw"], 1.0 - np.exp(-2.0 * time), atol=1e-6)
    np.testing.assert_allclose(controls["yaw"], 2.0 * np.exp(-2.0 * time), atol=1e-6)


@pytest.mark.parametrize("times", [(0.0, 0.0), (0.02, 0.05)])
def test_every_output_reaches_its_reference(times):
    time, states, controls = step_responses(MODEL, design_gains(MODEL, WEIGHTS, *times))
    assert time[0] == 0.0
    for output in ("x", "y", "z", "yaw"):
        assert states[output][0] == pytest.approx(0.0)
        assert states[output][-1] == pytest.approx(1.0, abs=0.01)
        assert controls[output][-1] == pytest.approx(0.0, abs=0.01)
    assert controls["x"][0] > 0.0 > controls["y"][0]
    assert math.isclose(controls["x"][0], -controls["y"][0])


@pytest.mark.parametrize(("yaw_pole", "duration"), [(0.4, 20.0), (0.01, 60.0)])
def test_step_responses_show_the_slowest_pole_for_a_minute_at_most(yaw_pole, duration):
    weights = Weights(np.diag([1.0, 1, 1, 1, 1, 1, yaw_pole**2]), np.eye(4), np.zeros((7, 4)))
    time, _, _ = step_responses(MODEL, design_gains(MODEL, weights))
    assert (time[0], time[-1]) == (0.0, pytest.approx(duration))


def test_bode_diagrams_begin_below_zero_and_leave_out_what_has_no_gain():
    # The thrust's loop is (3 s^2 + 3 s + 1) / s^3, the yaw's 1 / s.
    A, B, K = -np.eye(7), np.zeros((7, 4)), np.zeros((4, 7))
    A[:3, :3] = np.eye(3, k=1)
    A[6, 6], B[6, 2], K[2, 6] = 0.0, 1.0, -1.0
    B[2, 3], K[3, :3] = 1.0, (-1.0, -3.0, -3.0)
    magnitude, phase = Figure().subplots(2)
    _draw_bode(magnitude, phase, Design(K, A, B, 0.0))
    yaw, thrust, limit = (line.get_ydata() for line in phase.lines)
    np.testing.assert_allclose(yaw, -90.0)
    assert (thrust[0], thrust[-1]) == (pytest.approx(-270.0, abs=3), pytest.approx(-90.0, abs=3))
    assert set(limit) == {-180.0}
    yaw, _, unit = magnitude.lines
    np.testing.assert_allclose(yaw.get_ydata(), 1.0 / yaw.get_xdata())
    assert set(unit.get_ydata()) == {1.0}
