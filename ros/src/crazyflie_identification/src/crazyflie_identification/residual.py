"""What a fence has to expect of a vehicle: the bounds of its flights around a simpler model.

Along x, y and z the fence takes the acceleration to follow the commanded one with a first-order lag
and a delay. The rest is a disturbance.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, savgol_filter

from crazyflie_identification.fit import SETTLING, STEP, Fit, Recording, mean_commands
from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_state_estimator.motion import (
    ACCELERATION_WALK_WITH_CONTROL,
    POSITION_NOISE,
    ConstantAccelerationFilter,
)

PERIOD = 0.01  #: Of the positions that are compared (s).
WINDOW = 15  #: Positions to which a parabola is fitted: an acceleration is a mean of 0.1 s.
SHARE = 0.999  #: Of the flight that is within the bounds.
_FILTER_START = 100  #: Positions until the estimator's filter has forgotten its beginning.


def bounds(fit: Fit) -> dict[str, Any]:
    """Return the bounds of a fitted vehicle, as a model file has them, and the time they rest on.

    Disturbances (m/s^2) and errors of positions (m) are the quantile `SHARE` of its flight, used
    and unused part. The error of velocities (m/s) is the largest one beside these disturbances, of
    those that the estimator's Kalman filter finds; see `velocity_error`.
    """
    model = fit.model
    lag = {
        "horizontal": max(model.roll_lag or 0.0, model.pitch_lag or 0.0),
        "vertical": model.motor_time_constant,
    }
    parts = [_compared(fit, part, lag) for part in (fit.used, fit.unused)]
    accelerations, positions = (
        np.quantile(np.abs(np.concatenate(each)), SHARE, axis=0)
        for each in zip(*(part[:2] for part in parts), strict=True)
    )
    disturbances = (max(accelerations[:2]),) * 2 + (accelerations[2],)
    velocities = [
        velocity_error(sign * true[:, k], sign * measured[:, k], d, PERIOD)
        for _, _, true, measured in parts
        for k, d in enumerate(disturbances)
        for sign in (1.0, -1.0)
    ]
    seconds = sum(
        float(part.pose_times[-1] - part.pose_times[0]) for part in (fit.used, fit.unused)
    )
    return {
        "lag": {axis: float(value) for axis, value in lag.items()},
        "delay": float(model.delay),
        "disturbance": {
            "horizontal": float(disturbances[0]),
            "vertical": float(disturbances[2]),
        },
        "error": {"position": float(max(positions)), "velocity": float(max(velocities))},
        "seconds": round(seconds, 1),
    }


def _compared(fit: Fit, part: Recording, lag: dict[str, float]) -> tuple[NDArray[np.float64], ...]:
    """Return disturbances, errors of positions, and velocities, each of shape (k, 3).

    Velocities are true and estimated ones without what the controls explain.
    """
    start = part.pose_times[0] - SETTLING
    times = np.arange(start, part.pose_times[-1], STEP)
    model = fit.model
    roll, pitch, _, pwm = mean_commands(part, times - model.delay)
    yaw = np.interp(times, part.pose_times, part.poses[:, 5])
    control = [roll - model.roll_trim, pitch - model.pitch_trim, 0.0 * roll, model.thrust(pwm)]
    grid = np.arange(part.pose_times[0], part.pose_times[-1], PERIOD)
    measured = np.array([np.interp(grid, part.pose_times, part.poses[:, k]) for k in range(3)]).T
    commanded = coupled_acceleration(control, yaw)
    # The filter does not know of the delay.
    sent = [np.interp(grid + model.delay, times, u) for u in commanded]
    estimated = _estimated(measured, np.array(sent).T)
    found = []
    for k, (name, u) in enumerate(zip(("horizontal",) * 2 + ("vertical",), commanded, strict=True)):
        fade = np.exp(-STEP / lag[name])
        followed, _ = lfilter([1.0 - fade], [1.0, -fade], u, zi=[fade * u[0]])
        speed = np.cumsum(followed) * STEP
        way = np.cumsum(speed) * STEP
        gained = np.interp(grid, times, speed)
        rest = measured[:, k] - np.interp(grid, times, way)
        parts = (
            savgol_filter(rest, WINDOW, 3, 2, PERIOD),
            measured[:, k] - savgol_filter(measured[:, k], WINDOW, 3),
            savgol_filter(measured[:, k], WINDOW, 3, 1, PERIOD) - gained,
            estimated[:, k] - gained,
        )
        found.append([each[_FILTER_START:-WINDOW] for each in parts])
    return tuple(np.column_stack(each) for each in zip(*found, strict=True))


def _estimated(positions, accelerations):
    """Return the velocities, (k, 3), that the estimator finds on hardware."""
    kalman = ConstantAccelerationFilter(POSITION_NOISE, ACCELERATION_WALK_WITH_CONTROL)
    kalman.start(positions[0].tolist())
    rates = [[0.0] * 3]
    for position, acceleration in zip(positions[1:], accelerations[:-1], strict=True):
        rates.append(list(kalman.step(PERIOD, position.tolist(), acceleration.tolist())[1]))
    return np.array(rates)


def velocity_error(
    true: NDArray[np.float64], measured: NDArray[np.float64], disturbance: float, period: float
) -> float:
    """Return e_v, m/s: how far velocities are from predicted ones, beside a disturbance (m/s^2).

    That is the largest v(t) - v_m(t0) - g - D (t - t0) of all t >= t0, where g is what the controls
    explain. It has been subtracted from ``true`` and ``measured``, velocities v and v_m at equal
    steps (s), shapes (n,).
    """
    grown = disturbance * period * np.arange(len(true))
    return float(np.max(true - grown - np.minimum.accumulate(measured - grown)))
