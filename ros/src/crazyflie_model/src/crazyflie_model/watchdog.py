"""What the firmware flies when setpoints stop coming."""

from typing import Any

from crazyflie_model.dynamics import STEP
from crazyflie_model.elementwise import Vector, nowhere, where
from crazyflie_model.limits import LEVEL_AGE, OFF_AGE

_LEVEL_STEPS, _OFF_STEPS = round(LEVEL_AGE / STEP), round(OFF_AGE / STEP)


def watchdog_control(u: Vector[Any], age: Any) -> Vector[Any]:
    """Return what a vehicle flies of a control (see `Dynamics`) that is ``age`` steps old.

    From `LEVEL_AGE` on it is level and keeps its thrust, from `OFF_AGE` on its motors are off.
    """
    if nowhere(age >= _LEVEL_STEPS):
        return [*u]
    *attitude, thrust = u
    level = [where(age < _LEVEL_STEPS, each, 0.0) for each in attitude]
    return [*level, where(age < _OFF_STEPS, thrust, 0.0)]
