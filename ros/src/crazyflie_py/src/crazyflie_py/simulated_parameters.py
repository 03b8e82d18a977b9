"""Firmware parameters of an ideal vehicle: those of the virtual one, with its defaults."""

import functools
import logging
import math
from collections.abc import Mapping

from crazyflie_model.angles import Triple
from crazyflie_py.swarm import DEFAULT_COLOR, SwarmVehicle
from crazyflie_virtual.body import Physics
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.parameters import Parameter, parameter_specs
from crazyflie_virtual.settings import VehicleSettings, switches

_log = logging.getLogger(__name__)

_COLOR = ("ring.solidRed", "ring.solidGreen", "ring.solidBlue")


class SimulatedParameters:
    """Firmware parameters, "group.name" -> value.

    Only the groups and the LED's colour have an effect.

    Parameters
    ----------
    vehicle : SwarmVehicle
    said : set of str
        Names that have caused a warning, shared by all vehicles.
    """

    def __init__(self, vehicle: SwarmVehicle, said: set[str]):
        self._vehicle = vehicle
        self._said = said
        self._values: dict[str, float] = {}

    def update(self, values: Mapping[str, float]) -> None:
        """Set parameters; those that the virtual vehicle lacks are stored, with a warning."""
        for key, value in values.items():
            if key == "hlCommander.groupmask":
                self._vehicle.set_group_mask(int(value))
            elif key not in self._said and key not in _defaults():
                self._said.add(key)
                _log.warning(
                    "%s.setParam: the simulation has no parameter %s; it is stored without effect",
                    self._vehicle.name,
                    key,
                )
            self._check(key, value)
            self._values[key] = value

    def _check(self, key, value):
        spec = _specs().get(key)
        if spec is None:
            return
        low, high = spec.limits
        kind = spec.number_type
        if spec.limits != (-math.inf, math.inf) and not low <= value <= high:
            expected = f"{low:g} to {high:g}"
        elif not kind.is_float and kind.convert(value) != value:
            expected = f"a {kind.name}"
        else:
            return
        _log.warning(
            "%s.setParam: %s is %g; expected %s: a real vehicle refuses it",
            self._vehicle.name,
            key,
            value,
            expected,
        )

    def __getitem__(self, key: str) -> float:
        """Return a value; ValueError for a name that is not known and was not set."""
        if key == "hlCommander.groupmask":
            return self._vehicle.groups
        if key in self._values:
            return self._values[key]
        if key in _defaults():
            return _defaults()[key]
        group = key.partition(".")[0]
        known = [name for name in _defaults() if name.startswith(f"{group}.")]
        expected = ", ".join(known) if known else f"no group {group}; there are {_groups()}"
        raise ValueError(f"{self._vehicle.name}.getParam: name is {key}; expected {expected}")

    @property
    def led_color(self) -> Triple:
        """Red, green and blue, 0 to 1."""
        if not any(key in self._values for key in _COLOR):
            return DEFAULT_COLOR
        red, green, blue = (min(max(self[key] / 255.0, 0.0), 1.0) for key in _COLOR)
        return red, green, blue


@functools.cache
def _specs():
    return {f"{spec.group}.{spec.name}": spec for spec in parameter_specs()}


@functools.cache
def _defaults():
    settings = VehicleSettings.from_mapping({})
    firmware = Firmware(Physics(), switches(settings), settings)
    parameters = [Parameter(spec, firmware) for spec in parameter_specs()]
    return {parameter.full_name: parameter.default for parameter in parameters}


def _groups():
    return ", ".join(dict.fromkeys(name.partition(".")[0] for name in _defaults()))
