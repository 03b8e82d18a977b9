"""Models of vehicles: types by name, and model files."""

from crazyflie_model.quadrotor import TYPES, QuadrotorParameters
from crazyflie_utils.parameters.declaration import ParameterError
from crazyflie_utils.parameters.types import TEXT, Converted

#: Types of vehicles for which Bitcraze publishes no mass and no thrust.
UNPUBLISHED = {"bolt": "a Bolt has the frame, the motors and the mass that you gave it"}


def is_model(name: str) -> bool:
    """Return whether a text is the name of a type of vehicle, or that of a model file."""
    return name in TYPES or name in UNPUBLISHED or name.endswith((".yaml", ".yml"))


def load(name: str) -> QuadrotorParameters:
    """Return the model of a type, or of a model file.

    `ParameterError` names all errors: file, line, value, and what was expected.
    """
    if name in TYPES:
        return TYPES[name]
    if name in UNPUBLISHED or not is_model(name):
        reason = f": {UNPUBLISHED[name]}" if name in UNPUBLISHED else ""
        raise ParameterError(
            f"the model {name} does not exist{reason}; expected one of {', '.join(TYPES)}, or a "
            "model file, NAME.yaml"
        )
    # Imported here, since most vehicles are of a type: most nodes need no reader of YAML files.
    from crazyflie_utils.parameters import model_file

    return model_file.load(name)


def _checked(value):
    name = TEXT(value)
    try:
        load(name)
    except ParameterError as error:
        raise ValueError(str(error)) from None
    return name


#: Type of a parameter: the name of a type of vehicle, or the path of a model file, which is read.
VEHICLE_MODEL = Converted(
    _checked,
    f"one of {', '.join(TYPES)}, or the path of a model file",
    range=", ".join(f"`{name}`" for name in TYPES) + ", or a file",
)
