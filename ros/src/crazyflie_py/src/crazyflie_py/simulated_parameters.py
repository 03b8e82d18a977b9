"""Firmware parameters of an ideal vehicle: those of the virtual one, with its defaults."""

import functools
import logging
from collections.abc import Mapping

from crazyflie_model.angles import Triple
from crazyflie_py.swarm import DEFAULT_COLOR, SwarmVehicle
from crazyflie_virtual.body import Physics
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware_parameters import NO_LIMITS, ParameterPort, parameter_specs
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
        where = f"{self._vehicle.name}.setParam"
        for key, value in values.items():
            if key == "hlCommander.groupmask":
                self._vehicle.set_group_mask(int(value))
            if key in _known():
                spec, _ = _known()[key]
                if expected := _expected(spec, value):
                    text = "%s: %s is %g; expected %s: a real vehicle refuses it"
                    _log.warning(text, where, key, value, expected)
            elif key not in self._said:
                self._said.add(key)
                text = "%s: the simulation has no parameter %s; it is stored without effect"
                _log.warning(text, where, key)
            self._values[key] = value

    def __getitem__(self, key: str) -> float:
        """Return a value; ValueError for a name that is not known and was not set."""
        if key == "hlCommander.groupmask":
            return self._vehicle.groups
        if key in self._values:
            return self._values[key]
        if key in _known():
            return _known()[key][1]
        group = key.partition(".")[0]
        same = [name for name in _known() if name.startswith(f"{group}.")]
        groups = dict.fromkeys(name.partition(".")[0] for name in _known())
        expected = ", ".join(same) or f"no group {group}; there are {', '.join(groups)}"
        raise ValueError(f"{self._vehicle.name}.getParam: name is {key}; expected {expected}")

    @property
    def led_color(self) -> Triple:
        """Red, green and blue, 0 to 1."""
        if not any(key in self._values for key in _COLOR):
            return DEFAULT_COLOR
        red, green, blue = (min(max(self[key] / 255.0, 0.0), 1.0) for key in _COLOR)
        return red, green, blue


def _expected(spec, value):
    """Return what a real vehicle expects in place of a value; empty if it accepts that."""
    (low, high), kind = spec.limits, spec.number_type
    if spec.limits != NO_LIMITS and not low <= value <= high:
        return f"{low:g} to {high:g}"
    return "" if kind.is_float or kind.convert(value) == value else f"a {kind.name}"


@functools.cache
def _known():
    """Return the parameters of a virtual vehicle by their names, each with its default."""
    settings = VehicleSettings.from_mapping({})
    firmware = Firmware(Physics(), switches(settings), settings)
    defaults = ParameterPort(firmware, {}).defaults
    return {spec.full_name: (spec, defaults[spec.full_name]) for spec in parameter_specs()}
