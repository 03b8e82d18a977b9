"""Model files: YAML files with the figures of one vehicle."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import yaml
from typing_extensions import override

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE
from crazyflie_model.quadrotor import TYPES, QuadrotorParameters
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import ListOf, Number, Text

#: Key of a model file below which `identify` stores the origin of its figures.
RESULT = "identified"

_INERTIA = Number("kg m^2", minimum=1e-7, maximum=0.1)
_DRAG = Number("kg", minimum=0.0, maximum=1e-3)
_LAG = Number("s", minimum=0.001, maximum=1.0)
_TRIM = Number("rad", minimum=-0.2, maximum=0.2)


class ModelParameters(Parameters):
    """Figures of a model file; those that are missing are the type's."""

    type: str = parameter(
        Text(tuple(TYPES)), "type of vehicle that supplies the missing figures", "cf21"
    )
    mass: float | None = parameter(
        Number("kg", minimum=0.005, maximum=2.0),
        "mass with battery and decks; 33 g are 0.033",
        None,
    )
    arm: float | None = parameter(
        Number("m", minimum=0.01, maximum=1.0), "distance from the centre to a rotor's axis", None
    )
    thrust_curve: tuple[float, float] | None = parameter(
        ListOf(Number("N", minimum=-100.0, maximum=100.0), 2),
        "`[a, b]`: the thrust of a rotor is a f + b f^2 at a command f from 0 to 1",
        None,
    )
    motor_time_constant: float | None = parameter(
        Number("s", minimum=0.001, maximum=0.5), "first-order lag of the rotors' speed", None
    )
    drag_horizontal: float | None = parameter(
        _DRAG, "drag over airspeed over the sum of the rotor speeds, across their axes", None
    )
    drag_vertical: float | None = parameter(_DRAG, "the same ratio along the rotors' axes", None)
    inertia_x: float | None = parameter(_INERTIA, "moment of inertia about forward", None)
    inertia_y: float | None = parameter(_INERTIA, "moment of inertia about left", None)
    inertia_z: float | None = parameter(_INERTIA, "moment of inertia about up", None)
    torque_per_thrust: float | None = parameter(
        Number("m", minimum=1e-4, maximum=1.0), "torque of a rotor over its thrust", None
    )
    delay: float | None = parameter(
        Number("s", minimum=0.0, maximum=0.3), "delay from a command to the motion", None
    )
    roll_lag: float | None = parameter(
        _LAG, "first-order lag of roll behind its command", None, "lag/roll"
    )
    pitch_lag: float | None = parameter(_LAG, "the same of pitch", None, "lag/pitch")
    yaw_lag: float | None = parameter(_LAG, "the same of the yaw rate", None, "lag/yaw")
    roll_trim: float | None = parameter(
        _TRIM, "added to a command, so that the vehicle does not drift", None, "trim/roll"
    )
    pitch_trim: float | None = parameter(_TRIM, "the same of pitch", None, "trim/pitch")
    tilt_limit: float | None = parameter(
        Number("rad", minimum=0.15, maximum=MAX_TILT),
        "largest roll and pitch that the takeoff filter passes on",
        None,
        "limits/tilt",
    )
    yaw_rate_limit: float | None = parameter(
        Number("rad/s", minimum=0.1, maximum=MAX_YAW_RATE),
        "the same of the yaw rate",
        None,
        "limits/yaw_rate",
    )
    thrust_limit: float | None = parameter(
        Number("m/s^2", minimum=12.5, maximum=MAX_THRUST),
        "the same of the thrust over the mass",
        None,
        "limits/thrust",
    )

    @override
    def complaints(self) -> list[str]:
        curve, figures = self.thrust_curve, self.figures()
        # A curve that falls anywhere between zero and full command has no inverse.
        if curve is not None and (curve[0] <= 0.0 or curve[0] + 2.0 * curve[1] <= 0.0):
            return [
                f"thrust_curve is {list(curve)}; expected one that rises from command 0 to 1: "
                "a > 0 and a + 2 b > 0"
            ]
        if figures.max_thrust < 1.05 * 9.81:
            return [
                f"mass is {figures.mass:g} kg, and the rotors lift {figures.max_thrust / 9.81:.2f} "
                "times the weight at the largest command; expected at least 1.05 times: a smaller "
                "mass or a stronger thrust_curve"
            ]
        return []

    def figures(self) -> QuadrotorParameters:
        """Return the figures of the vehicle."""
        names = {each.name for each in fields(QuadrotorParameters)}
        given = {k: v for k, v in vars(self).items() if k in names and v is not None}
        if self.thrust_curve is not None:
            linear, quadratic = self.thrust_curve
            given |= {"thrust_linear": linear, "thrust_quadratic": quadratic}
        model = replace(TYPES[self.type], **given)
        if self.thrust_curve is not None:
            model = replace(model, max_rotor_speed=model.rotor_speed(65535.0))
        return model


def load(path: str) -> QuadrotorParameters:
    """Return the model in a file; see `vehicle_model.load`."""
    return yaml_file.load(path).read(ModelParameters, (RESULT,)).figures()


def save(path: Path, type: str, model: QuadrotorParameters, result: dict[str, Any]) -> None:  # noqa: A002
    """Write a model file; ``result`` states the origin of its figures.

    OSError: it cannot be written.
    """
    tree: dict[str, Any] = {"type": type, "mass": model.mass}
    tree["thrust_curve"] = [model.thrust_linear, model.thrust_quadratic]
    for name in ("motor_time_constant", "drag_horizontal", "drag_vertical", "delay"):
        tree[name] = getattr(model, name)
    lag = {axis: getattr(model, f"{axis}_lag") for axis in ("roll", "pitch", "yaw")}
    tree["lag"] = {axis: value for axis, value in lag.items() if value is not None}
    tree["trim"] = {"roll": model.roll_trim, "pitch": model.pitch_trim}
    tree[RESULT] = result
    text = yaml.safe_dump(tree, sort_keys=False)
    path.write_text(f"# Model of one vehicle, SI units.\n{text}", encoding="utf-8")
