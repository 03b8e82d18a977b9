"""The bounds of a vehicle, on which the fence's proof (docs/geofence_proof.md) rests.

They are parameters of the node, or stand in a model file.
"""

from dataclasses import fields, replace
from typing import Any

from crazyflie_geofence.geofence import LARGEST_HORIZONTAL, LARGEST_VERTICAL
from crazyflie_geofence.viable_set import Axis
from crazyflie_model.quadrotor import TYPES
from crazyflie_model.units import GRAVITY
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters import vehicle_model, yaml_file
from crazyflie_utils.parameters.declaration import ParameterError
from crazyflie_utils.parameters.model_file import RESULT
from crazyflie_utils.parameters.types import Number

KEY = "bounds"  #: Key of a model file, below that of what identify found, of its bounds.


def _bound(name: str, unit: str, minimum: float, maximum: float, help: str) -> Any:  # noqa: A002
    return parameter(Number(unit, minimum=minimum, maximum=maximum), help, None, name)


class Bounds(Parameters):
    """Within what a vehicle follows its controls; None where nothing is given."""

    horizontal_lag: float | None = _bound(
        "lag/horizontal", "s", 0.001, 0.5, "tau: first-order lag of the acceleration along x and y"
    )
    vertical_lag: float | None = _bound("lag/vertical", "s", 0.001, 0.5, "tau along z")
    delay: float | None = _bound(
        "delay", "s", 0.0, 0.3, "from a pose to the motion by the control that answers it"
    )
    horizontal_disturbance: float | None = _bound(
        "disturbance/horizontal", "m/s^2", 0.0, 5.0, "D: largest other acceleration along x and y"
    )
    vertical_disturbance: float | None = _bound(
        "disturbance/vertical", "m/s^2", 0.0, 5.0, "D along z"
    )
    position_error: float | None = _bound(
        "error/position", "m", 0.0, 0.5, "largest error of a measured position"
    )
    velocity_error: float | None = _bound(
        "error/velocity",
        "m/s",
        0.0,
        1.0,
        "e_v: largest error of an estimated velocity, and of one predicted from it beside D",
    )


#: Bounds of the Crazyflie 2.1, which no flight of docs/geofence_proof.md exceeds: of vehicles that
#: are simulated, with velocities from differences of poses; no real vehicle.
_CF21 = Bounds(
    horizontal_lag=0.12,
    vertical_lag=0.05,
    delay=0.02,
    horizontal_disturbance=0.6,
    vertical_disturbance=1.0,
    position_error=0.002,
    velocity_error=0.06,
)
_OF_TYPES = {
    "cf21": _CF21,
    "cf21_markers": replace(_CF21, velocity_error=0.1),
    # A heavy one has little thrust to brake with.
    "cf21plus": replace(_CF21, velocity_error=0.16, vertical_disturbance=1.4),
    "brushless": replace(_CF21, velocity_error=0.13),
}

SPREAD, PERIOD = 0.01, 0.01  #: Of `Axis` where none are given (s).

#: Share of the rotors' thrust that a battery leaves under load: 3.8 V of 4.2 V. With more thrust
#: than that, attitude loops have no torque.
_LOADED = (3.8 / 4.2) ** 2


def load(model: str) -> Bounds:
    """Return the bounds of a type, or of a model file: None where it has none.

    `ParameterError` names errors of the file with their lines.
    """
    if model in TYPES:
        return _OF_TYPES[model]
    found = yaml_file.load(model)
    if RESULT not in found or KEY not in found[RESULT]:
        return Bounds()
    return found[RESULT][KEY].read(Bounds, ("seconds",))


def complete(given: Bounds, model: str) -> Bounds:
    """Return bounds in which what is not given is the model's.

    `ParameterError`: the model does not have it either.
    """
    own, names = load(model), [each.name for each in Bounds.declarations()]
    values = {}
    for field, name in zip(fields(Bounds), names, strict=True):
        value = getattr(given, field.name)
        values[field.name] = getattr(own, field.name) if value is None else value
        if values[field.name] is None:
            raise ParameterError(
                f"bounds/{name} is not known: the model {model} has no {RESULT}/{KEY}/{name}; "
                "expected a model file that identify has written, or the parameter"
            )
    return Bounds(**values)


def axes(
    bounds: Bounds,
    horizontal: float,
    vertical: float,
    spread: float = SPREAD,
    period: float = PERIOD,
) -> tuple[Axis, Axis, Axis]:
    """Return the bounds of x, y and z, which brake with ``horizontal`` and ``vertical``, m/s^2.

    ``bounds`` are complete; for spread and period (s) see `Axis`.
    """
    of = vars(bounds)
    rest = (of["position_error"], of["velocity_error"], of["delay"], spread, period)
    x, z = (
        Axis(of[f"{name}_lag"], braking, largest, of[f"{name}_disturbance"], *rest)
        for name, braking, largest in (
            ("horizontal", horizontal, LARGEST_HORIZONTAL),
            ("vertical", vertical, LARGEST_VERTICAL),
        )
    )
    return x, x, z


def max_thrust(model: str) -> float:
    """Return the largest thrust over the mass that the fence gives a vehicle of a model, m/s^2."""
    figures = vehicle_model.load(model)
    of_rotors = GRAVITY * (figures.max_rotor_speed / figures.hover_speed) ** 2
    return min(figures.max_thrust, figures.thrust_limit, _LOADED * of_rotors)
