"""Firmware parameters as ROS parameters, PREFIX/GROUP/NAME."""

from dataclasses import dataclass, field

from typing_extensions import override

from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_utils import NodeHandle, ParameterError, ServiceError
from crazyflie_utils.parameters.types import ParameterType

_XMLRPC_INTEGERS = range(-(2**31), 2**31)

#: Parameters that trigger an action instead of keeping a value: not for a vehicle in the air.
_COMMANDS = ("kalman.resetEstimation",)


@dataclass(eq=False)
class ParameterMirror:
    """Copy the firmware's parameters to ROS, and back on demand; all methods block."""

    _handle: NodeHandle
    _prefix: str
    _crazyflie: Crazyflie
    _written: dict[str, int | float] = field(default_factory=dict)

    def reapply_parameters(self) -> list[str]:
        """Write what `write` has written since the start: a vehicle that was off has forgotten it.

        Returns why parameters could not be written; all are tried, unless the link is lost.
        """
        problems = []
        for name, value in self._written.items():
            if name in _COMMANDS:
                continue
            try:
                self._crazyflie.parameters.write(name, value)
            except LinkLostError:
                raise
            except CrazyflieError as error:
                problems.append(str(error))
        return problems

    def publish(self) -> int:
        """Set the ROS parameters to the firmware's values; return how many there are."""
        groups: dict[str, dict[str, int | float]] = {}
        values = self._crazyflie.parameters.values()
        for name, value in values.items():
            group, _, parameter = name.partition(".")
            groups.setdefault(group, {})[parameter] = _portable(value)
        # Group by group: all in one would take everything else below the prefix away.
        for group, parameters in groups.items():
            self._handle.set_param(f"{self._prefix}/{group}", parameters)
        return len(values)

    def write(self, names: list[str]) -> None:
        """Write parameters, named GROUP/NAME, with the values of the ROS parameters.

        All are tried, and a `ServiceError` names those that could not be written; the ROS
        parameters are then what the firmware has confirmed.
        """
        problems = []
        for name in names:
            try:
                self._write(name)
            except (CrazyflieError, ParameterError) as error:
                problems.append(str(error))
        if problems:
            raise ServiceError("; ".join(problems))

    def _write(self, name):
        firmware_name = parsed_name(name)
        full_name = f"{self._prefix}/{firmware_name.replace('.', '/')}"
        self.set(firmware_name, self._handle.get_param(full_name, _FirmwareValue()))

    def set(self, name: str, value: float) -> None:
        """Write a parameter, named GROUP.NAME; the ROS parameter is then what is confirmed."""
        confirmed = self._crazyflie.parameters.write(name, value)
        self._written[name] = value
        self._handle.set_param(f"{self._prefix}/{name.replace('.', '/')}", _portable(confirmed))


def parsed_name(name: str) -> str:
    """Return GROUP.NAME of a firmware parameter that a caller names; or raise `ParameterError`."""
    group, _, parameter = name.strip("/").replace(".", "/").partition("/")
    if not group or not parameter:
        raise ParameterError(f"{name!r} is no firmware parameter; expected GROUP/NAME")
    return f"{group}.{parameter}"


class _FirmwareValue(ParameterType):
    """A number, or a truth value for a switch."""

    label = "float"

    @override
    def __call__(self, value: object) -> int | float:
        if not isinstance(value, (bool, int, float)):
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        return "a number"


def _portable(value):
    # XML-RPC, and so ROS, knows integers of 32 bits only.
    return float(value) if isinstance(value, int) and value not in _XMLRPC_INTEGERS else value
