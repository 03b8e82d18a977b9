"""Port 2: parameters."""

import errno
import struct
from operator import attrgetter

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.link.crtp import MAX_DATA
from crazyflie_virtual.tables.number_types import PARAMETER_CODES, PARAMETER_TYPES
from crazyflie_virtual.tables.parameter_table import NO_LIMITS, ParameterSpec, parameter_specs
from crazyflie_virtual.tables.toc import Table

_TABLE, _READ, _WRITE, _MISC = 0, 1, 2, 3

_SET_BY_NAME, _EXTENDED_TYPE, _STORE, _STATE, _CLEAR = 0, 2, 3, 4, 5
_DEFAULT, _EXTENDED_TYPE_2, _DEFAULT_2 = 6, 7, 8

_WORD = 4  #: Bytes of a request in which the answer to a write has the value as it is.
_PERSISTENT = 1  #: The only extended type.
_EXTENDED, _CORE, _READ_ONLY = 0x10, 0x20, 0x40  #: Flags beside the type's code.

_NO_ENTRY = bytes([errno.ENOENT])


class Parameter:
    """A parameter of a firmware that runs."""

    def __init__(self, spec: ParameterSpec, firmware: Firmware):
        self.spec = spec
        self.full_name = f"{spec.group}.{spec.name}"
        self._owner = None
        if isinstance(spec.source, str):
            path, _, self._attribute = spec.source.rpartition(".")
            self._owner = attrgetter(path)(firmware) if path else firmware
        else:
            self._value = spec.source
        self.default = self.value

    @property
    def value(self) -> float:
        """The present value."""
        return self._value if self._owner is None else getattr(self._owner, self._attribute)

    @property
    def has_effect(self) -> bool:
        """Whether the vehicle does anything with it."""
        return self._owner is not None

    def set(self, value: float) -> None:
        """Change the value; ValueError if it is out of its limits."""
        low, high = self.spec.limits
        if not low <= value <= high and self.spec.limits != NO_LIMITS:
            raise ValueError(f"is {low:g} to {high:g}, not {value:g}")
        if self._owner is None:
            self._value = value
        else:
            setattr(self._owner, self._attribute, value)

    @property
    def code(self) -> int:
        """Type and flags in the table."""
        spec = self.spec
        extended = _EXTENDED if spec.persistent else 0
        access = _READ_ONLY if spec.read_only else _CORE
        return PARAMETER_CODES[spec.number_type] | extended | access


class ParameterPort:
    """Reads and writes parameters, and stores the persistent ones.

    What is ``stored``, by full name, outlives a restart of the vehicle; it is applied at once.
    """

    def __init__(self, firmware: Firmware, stored: dict[str, float]):
        self._parameters = [Parameter(spec, firmware) for spec in parameter_specs()]
        self._stored = stored
        self._warn = firmware.warn
        for parameter in self._parameters:
            if parameter.full_name in stored:
                parameter.set(stored[parameter.full_name])
        self.table = Table([(p.spec.group, p.spec.name, p.code) for p in self._parameters])

    def handle(self, channel: int, data: bytes) -> bytes | None:
        """Return the data of the answer; None for no answer."""
        if channel == _TABLE:
            return self.table.answer(data)
        if channel == _MISC:
            return self._misc(data)
        if len(data) < 2:
            return None
        return self._read(data) if channel == _READ else self._write(data)

    def _find(self, data, at=0):
        (index,) = struct.unpack_from("<H", data, at)
        return self._parameters[index] if index < len(self._parameters) else None

    def _read(self, data):
        parameter = self._find(data)
        if parameter is None:
            return data[:2] + _NO_ENTRY
        return data[:2] + b"\0" + parameter.spec.number_type.pack(parameter.value)

    def _write(self, data):
        parameter = self._find(data)
        if parameter is None:
            self._warn("parameter", f"PARAM: there is none with the number {data[:2].hex()}")
            return data[:2] + _NO_ENTRY
        if parameter.spec.read_only:
            self._warn(parameter.full_name, f"PARAM: {parameter.full_name} is read-only")
            return None
        self._set(parameter, data[2:])
        # As long as the request, whatever the value's size is.
        value = parameter.spec.number_type.pack(parameter.value).ljust(_WORD, b"\0")
        return data[:2] + (value[: len(data) - 2] + data[2 + len(value) :])

    def _set(self, parameter, data):
        number_type = parameter.spec.number_type
        value = number_type.unpack(data[: number_type.size].ljust(number_type.size, b"\0"))
        name = parameter.full_name
        if not parameter.has_effect and value != parameter.value:
            self._warn(name, f"PARAM: {name} is kept, but a virtual vehicle does nothing with it")
        try:
            parameter.set(value)
        except ValueError as error:
            self._warn(name, f"PARAM: {name} {error}")

    def _misc(self, data):
        if not data:
            return None
        if data[0] == _SET_BY_NAME:
            return self._set_by_name(data)
        if data[0] not in _MISC_HANDLERS or len(data) < 3:
            self._warn("parameter command", f"PARAM: unknown command {data.hex()}")
            return None
        parameter = self._find(data, 1)
        answer = None if parameter is None else _MISC_HANDLERS[data[0]](self, parameter)
        return data[:3] + (_NO_ENTRY if answer is None else answer)

    def _set_by_name(self, data):
        parts = data[1:].split(b"\0", 2)
        if len(parts) < 3 or not parts[2]:
            return None
        group, name = parts[0].decode("latin1"), parts[1].decode("latin1")
        index = self.table.index(group, name)
        number_type = PARAMETER_TYPES.get(parts[2][0])
        error = 0
        if index is None:
            error = errno.ENOENT
        elif number_type is not self._parameters[index].spec.number_type:
            error = errno.EINVAL
        elif self._parameters[index].spec.read_only:
            error = errno.EACCES
        else:
            self._set(self._parameters[index], parts[2][1:])
        names = data[: 1 + len(parts[0]) + 1 + len(parts[1]) + 1]
        return (names + bytes([error]))[:MAX_DATA]

    # Answers to the other commands; None where the parameter does not have what is asked for.

    def _extended_type(self, parameter):
        return bytes([_PERSISTENT]) if parameter.spec.persistent else None

    def _default(self, parameter):
        spec = parameter.spec
        return None if spec.read_only else spec.number_type.pack(parameter.default)

    def _store(self, parameter):
        if not parameter.spec.persistent:
            return None
        self._stored[parameter.full_name] = parameter.value
        return b"\0"

    def _clear(self, parameter):
        return None if self._stored.pop(parameter.full_name, None) is None else b"\0"

    def _state(self, parameter):
        number_type = parameter.spec.number_type
        default = number_type.pack(parameter.default)
        if parameter.full_name not in self._stored:
            return b"\0" + default
        return b"\1" + default + number_type.pack(self._stored[parameter.full_name])


def _with_status(handler):
    # The later commands put a 0 before an answer that is no error.
    def handle(port, parameter):
        answer = handler(port, parameter)
        return None if answer is None else b"\0" + answer

    return handle


_MISC_HANDLERS = {
    _EXTENDED_TYPE: ParameterPort._extended_type,
    _STORE: ParameterPort._store,
    _STATE: ParameterPort._state,
    _CLEAR: ParameterPort._clear,
    _DEFAULT: ParameterPort._default,
    _EXTENDED_TYPE_2: _with_status(ParameterPort._extended_type),
    _DEFAULT_2: _with_status(ParameterPort._default),
}
