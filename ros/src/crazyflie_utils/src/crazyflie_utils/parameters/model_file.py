"""Model files: YAML files with the figures of one vehicle."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import yaml
from typing_extensions import override

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE
from crazyflie_model.quadrotor import TYPES, QuadrotorParameters
from crazyflie_model.units import GRAVITY
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import ListOf, Number, Text
from crazyflie_utils.text_file import read_text

#: Key of a model file below which `identify` stores the origin of its figures.
RESULT = "identified"


def _figure(unit: str, minimum: float, maximum: float, help: str, name: str = "") -> Any:  # noqa: A002
    return parameter(Number(unit, minimum=minimum, maximum=maximum), help, None, name)


class ModelParameters(Parameters):
    """Figures of a model file; those that are missing are the type's."""

    type: str = parameter(
        Text(tuple(TYPES)), "type of vehicle that supplies the missing figures", "cf21"
    )
    mass: float | None = _figure("kg", 0.005, 2.0, "mass with battery and decks; 33 g are 0.033")
    arm: float | None = _figure("m", 0.01, 1.0, "distance from the centre to a rotor's axis")
    thrust_curve: tuple[float, float] | None = parameter(
        ListOf(Number("N", minimum=-100.0, maximum=100.0), 2),
        "`[a, b]`: the thrust of a rotor is a f + b f^2 at a command f from 0 to 1",
        None,
    )
    motor_time_constant: float | None = _figure(
        "s", 0.001, 0.5, "first-order lag of the rotors' speed"
    )
    drag_horizontal: float | None = _figure(
        "kg", 0.0, 1e-3, "drag over airspeed over the sum of the rotor speeds, across their axes"
    )
    drag_vertical: float | None = _figure("kg", 0.0, 1e-3, "the same ratio along the rotors' axes")
    inertia_x: float | None = _figure("kg m^2", 1e-7, 0.1, "moment of inertia about forward")
    inertia_y: float | None = _figure("kg m^2", 1e-7, 0.1, "moment of inertia about left")
    inertia_z: float | None = _figure("kg m^2", 1e-7, 0.1, "moment of inertia about up")
    torque_per_thrust: float | None = _figure("m", 1e-4, 1.0, "torque of a rotor over its thrust")
    delay: float | None = _figure("s", 0.0, 0.3, "delay from a command to the motion")
    roll_lag: float | None = _figure(
        "s", 0.001, 1.0, "first-order lag of roll behind its command", "lag/roll"
    )
    pitch_lag: float | None = _figure("s", 0.001, 1.0, "the same of pitch", "lag/pitch")
    yaw_lag: float | None = _figure("s", 0.001, 1.0, "the same of the yaw rate", "lag/yaw")
    roll_trim: float | None = _figure(
        "rad", -0.2, 0.2, "added to a command, so that the vehicle does not drift", "trim/roll"
    )
    pitch_trim: float | None = _figure("rad", -0.2, 0.2, "the same of pitch", "trim/pitch")
    tilt_limit: float | None = _figure(
        "rad",
        0.15,
        MAX_TILT,
        "largest roll and pitch that the takeoff filter passes on",
        "limits/tilt",
    )
    yaw_rate_limit: float | None = _figure(
        "rad/s", 0.1, MAX_YAW_RATE, "the same of the yaw rate", "limits/yaw_rate"
    )
    thrust_limit: float | None = _figure(
        "m/s^2", 12.5, MAX_THRUST, "the same of the thrust over the mass", "limits/thrust"
    )

    @override
    def complaints(self) -> list[str]:
        curve = self.thrust_curve
        # A curve that falls anywhere between zero and full command has no inverse.
        if curve is not None and (curve[0] <= 0.0 or curve[0] + 2.0 * curve[1] <= 0.0):
            return [
                f"thrust_curve is {list(curve)}; expected one that rises from command 0 to 1: "
                "a > 0 and a + 2 b > 0"
            ]
        model = self.figures()
        lifted = model.max_thrust / GRAVITY
        if lifted < 1.05:
            return [
                f"mass is {model.mass:g} kg, and the rotors lift {lifted:.2f} times the weight at "
                "the largest command; expected at least 1.05 times: a smaller mass or a stronger "
                "thrust_curve"
            ]
        return []

    def figures(self) -> QuadrotorParameters:
        """Return the figures of the vehicle."""
        names = {each.name for each in fields(QuadrotorParameters)}
        given = {k: v for k, v in vars(self).items() if k in names and v is not None}
        model = replace(TYPES[self.type], **given)
        return model if self.thrust_curve is None else model.with_thrust_curve(*self.thrust_curve)


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


def save_with_hover(path: Path, model: str, pwm: float) -> None:
    """Write a type or a model file with its thrust curve scaled: it hovers at a command (PWM).

    OSError: it cannot be written.
    """
    is_type = model in TYPES
    figures = TYPES[model] if is_type else load(model)
    tree: dict[str, Any] = {"type": model} if is_type else yaml.safe_load(read_text(model))
    scale = GRAVITY / figures.thrust(pwm)
    tree["thrust_curve"] = [scale * figures.thrust_linear, scale * figures.thrust_quadratic]
    tree[RESULT] = {"hover_pwm": pwm}
    path.write_text(yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")
