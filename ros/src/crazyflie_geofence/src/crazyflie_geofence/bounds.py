"""The bounds of a vehicle, on which the fence rests: parameters of the node, or of a model file."""

from dataclasses import fields, replace
from typing import Any

from crazyflie_geofence.geofence import CERTAIN_HORIZONTAL, LARGEST_HORIZONTAL, LARGEST_VERTICAL
from crazyflie_geofence.viable_set import Axis
from crazyflie_model.quadrotor import TYPES
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
_OF_TYPES = Bounds(
    horizontal_lag=0.12,
    vertical_lag=0.05,
    delay=0.02,
    horizontal_disturbance=0.6,
    vertical_disturbance=1.0,
    position_error=0.002,
)

#: e_v of each type (m/s). A battery that sags leaves too little for the attitude of a cf21plus.
_VELOCITY_ERRORS = {"cf21": 0.06, "cf21_markers": 0.1, "cf21plus": 0.36, "brushless": 0.1}


def load(model: str) -> Bounds:
    """Return the bounds of a type, or of a model file: None where it has none.

    `ParameterError` names errors of the file with their lines.
    """
    if model in TYPES:
        return replace(_OF_TYPES, velocity_error=_VELOCITY_ERRORS[model])
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
    bounds: Bounds, horizontal: float, vertical: float, spread: float, period: float
) -> tuple[Axis, Axis, Axis]:
    """Return the bounds of x, y and z, which brake with ``horizontal`` and ``vertical``, m/s^2.

    ``bounds`` are complete; for spread and period (s) see `Axis`.
    """
    of = vars(bounds)
    rest = (of["position_error"], of["velocity_error"], of["delay"], spread, period)
    largest, sure = LARGEST_HORIZONTAL, max(CERTAIN_HORIZONTAL, horizontal)
    x = Axis(of["horizontal_lag"], horizontal, largest, of["horizontal_disturbance"], *rest, sure)
    largest, sure = LARGEST_VERTICAL, vertical
    z = Axis(of["vertical_lag"], vertical, largest, of["vertical_disturbance"], *rest, sure)
    return x, x, z


def max_thrust(model: str) -> float:
    """Return the largest thrust over the mass that a vehicle of a model has, m/s^2."""
    figures = vehicle_model.load(model)
    return min(figures.max_thrust, figures.thrust_limit)
