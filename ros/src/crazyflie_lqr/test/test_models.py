"""The linear models against derivatives of the nonlinear ones."""

from functools import partial

import numpy as np
import pytest

from crazyflie_lqr.models import full_state, near_hover
from crazyflie_model.dynamics import Coupled7D, NearHover, coupled_acceleration
from crazyflie_model.units import GRAVITY

HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])


def first_order_attitude(x, u):
    """Return the rates of a vehicle whose roll and pitch lag by 1/6 s, measured 10 ms late."""
    roll_rate, pitch_rate = 6.0 * (u[0] - x[6]), 6.0 * (u[1] - x[7])
    acceleration = coupled_acceleration([x[6], x[7], u[2], u[3]], x[8])
    measured = (np.array([roll_rate, pitch_rate, u[2]]) - x[9:12]) / 0.01
    return [*x[3:6], *acceleration, roll_rate, pitch_rate, u[2], *measured]


def jacobian(function, at):
    step = 1e-6
    columns = [
        (np.array(function(at + d)) - np.array(function(at - d))) / (2.0 * step)
        for d in step * np.eye(len(at))
    ]
    return np.array(columns).T


@pytest.mark.parametrize(
    ("make_model", "rates"),
    [
        (near_hover, partial(NearHover().derivative, 0.0)),
        (near_hover, partial(Coupled7D().derivative, 0.0)),
        (full_state, first_order_attitude),
    ],
)
def test_is_the_derivative_at_hover(make_model, rates):
    model = make_model()
    x = np.zeros(model.x_dim)
    np.testing.assert_allclose(rates(x, HOVER), np.zeros(model.x_dim))
    np.testing.assert_allclose(model.A, jacobian(lambda v: rates(v, HOVER), x), atol=1e-6)
    np.testing.assert_allclose(model.B, jacobian(lambda v: rates(x, v), HOVER), atol=1e-6)
