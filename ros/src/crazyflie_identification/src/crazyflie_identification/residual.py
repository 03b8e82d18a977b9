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

PERIOD = 0.01  #: Of the positions that are compared (s).
WINDOW = 15  #: Positions to which a parabola is fitted: an acceleration is a mean of 0.1 s.
SHARE = 0.999  #: Of the flight that is within the bounds.


def bounds(fit: Fit) -> dict[str, Any]:
    """Return the bounds of a fitted vehicle, as a model file has them, and the time they rest on.

    They are the quantile `SHARE` of its flight, used and unused part: disturbances (m/s^2) and
    errors of positions (m) and of their differences (m/s).
    """
    model = fit.model
    lag = {
        "horizontal": max(model.roll_lag or 0.0, model.pitch_lag or 0.0),
        "vertical": model.motor_time_constant,
    }
    parts = [_compared(fit, part, lag) for part in (fit.used, fit.unused)]
    accelerations, positions, velocities = (
        np.quantile(np.abs(np.concatenate(each)), SHARE, axis=0)
        for each in zip(*parts, strict=True)
    )
    seconds = sum(
        float(part.pose_times[-1] - part.pose_times[0]) for part in (fit.used, fit.unused)
    )
    return {
        "lag": {axis: float(value) for axis, value in lag.items()},
        "delay": float(model.delay),
        "disturbance": {
            "horizontal": float(max(accelerations[:2])),
            "vertical": float(accelerations[2]),
        },
        "error": {"position": float(max(positions)), "velocity": float(max(velocities))},
        "seconds": round(seconds, 1),
    }


def _compared(fit: Fit, part: Recording, lag: dict[str, float]) -> tuple[NDArray[np.float64], ...]:
    """Return disturbances, errors of positions, and of velocities, each of shape (k, 3)."""
    start = part.pose_times[0] - SETTLING
    times = np.arange(start, part.pose_times[-1], STEP)
    model = fit.model
    roll, pitch, _, pwm = mean_commands(part, times - model.delay)
    yaw = np.interp(times, part.pose_times, part.poses[:, 5])
    control = [roll - model.roll_trim, pitch - model.pitch_trim, 0.0 * roll, model.thrust(pwm)]
    grid = np.arange(part.pose_times[0], part.pose_times[-1], PERIOD)
    found = []
    commanded = coupled_acceleration(control, yaw)
    for k, (name, u) in enumerate(zip(("horizontal",) * 2 + ("vertical",), commanded, strict=True)):
        fade = np.exp(-STEP / lag[name])
        followed, _ = lfilter([1.0 - fade], [1.0, -fade], u, zi=[fade * u[0]])
        way = np.cumsum(np.cumsum(followed)) * STEP**2
        measured = np.interp(grid, part.pose_times, part.poses[:, k])
        rest = measured - np.interp(grid, times, way)
        smooth = savgol_filter(measured, WINDOW, 3)
        speed = savgol_filter(measured, WINDOW, 3, 1, PERIOD)
        found.append(
            (
                savgol_filter(rest, WINDOW, 3, 2, PERIOD)[WINDOW:-WINDOW],
                (measured - smooth)[WINDOW:-WINDOW],
                (np.gradient(measured, PERIOD) - speed)[WINDOW:-WINDOW],
            )
        )
    return tuple(np.column_stack(each) for each in zip(*found, strict=True))
