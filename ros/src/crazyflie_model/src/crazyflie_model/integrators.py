"""Numerical integration with a fixed step."""

from collections.abc import Callable

from crazyflie_model.elementwise import Number, Vector

Rates = Callable[[float, Vector[Number], Vector[Number]], Vector[Number]]


def rk4_step(
    rates: Rates[Number], t: float, x: Vector[Number], u: Vector[Number], dt: float
) -> Vector[Number]:
    """Return the state one classical Runge-Kutta step (4th order) of ``dt`` (s) later.

    ``rates(t, x, u)`` is the time derivative of every component of the state x at time t (s); the
    control u is constant over the step.
    """
    half = dt / 2.0
    sixth = dt / 6.0
    k1 = rates(t, x, u)
    k2 = rates(t + half, [xi + half * ki for xi, ki in zip(x, k1, strict=True)], u)
    k3 = rates(t + half, [xi + half * ki for xi, ki in zip(x, k2, strict=True)], u)
    k4 = rates(t + dt, [xi + dt * ki for xi, ki in zip(x, k3, strict=True)], u)
    return [
        xi + sixth * (a + 2.0 * (b + c) + d)
        for xi, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True)
    ]
