"""Parameters of the firmware: names, types, values."""

import os
import struct

from cflib.crazyflie.param import (
    MISC_CHANNEL,
    MISC_PERSISTENT_CLEAR,
    MISC_PERSISTENT_GET_STATE,
    MISC_PERSISTENT_STORE,
    READ_CHANNEL,
    WRITE_CHANNEL,
    ParamTocElement,
    PersistentParamState,
)
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import NoReplyError, RefusedError, ValueRangeError, unknown_name
from crazyflie_link.link import Link
from crazyflie_link.subsystem import Subsystem, elements
from crazyflie_link.transmission import Request


class FirmwareParameters(Subsystem):
    """The parameters of a vehicle; all were read when the link was set up."""

    def types(self) -> dict[str, tuple[str, bool]]:
        """Return the parameters: "group.name" -> (C type, whether it can be written)."""
        table = self._current_link().cflib.param.toc.toc
        return {
            name: (element.ctype, element.access == ParamTocElement.RW_ACCESS)
            for name, element in elements(table).items()
        }

    def values(self) -> dict[str, int | float]:
        """Return the values as last read or written: "group.name" -> int or float."""
        param = self._current_link().cflib.param
        return {
            name: _number(element, param.values[element.group][element.name])
            for name, element in elements(param.toc.toc).items()
            if element.name in param.values.get(element.group, {})
        }

    def known(self, name: str) -> int | float | None:
        """Return one of them, such as "ring.effect"; None if the vehicle does not have it."""
        param = self._current_link().cflib.param
        group, _, parameter = name.partition(".")
        text = param.values.get(group, {}).get(parameter)
        return None if text is None else _number(param.toc.get_element(group, parameter), text)

    def read(self, name: str) -> int | float:
        """Ask the vehicle for a parameter, such as "ring.effect"; blocks."""
        link = self._current_link()
        element = self._find(link, name)
        ident = struct.pack("<H", element.ident)
        request = Request(CRTPPort.PARAM, READ_CHANNEL, ident, f"reading {name}")
        answer = link.request(ident, request)
        # Identifier, status, value.
        if len(answer) < 3 or answer[2] != 0:
            raise _refusal(request, answer)
        return self._keep(link, element, answer[3:])

    def write(self, name: str, value: int | float) -> int | float:
        """Set a parameter and return the value that the vehicle confirms; blocks."""
        link = self._current_link()
        element = self._find(link, name)
        if element.access != ParamTocElement.RW_ACCESS:
            raise RefusedError(f"parameter {name} can only be read")
        ident = struct.pack("<H", element.ident)
        data = ident + self._pack(element, name, value)

        def accepts(answer: bytes) -> bool:
            # The reply to an earlier write has another value.
            return answer == data or len(answer) != len(data)

        request = Request(CRTPPort.PARAM, WRITE_CHANNEL, ident, f"writing {name}", accepts=accepts)
        try:
            answer = link.request(data, request)
        except NoReplyError as error:
            # Only the reply may have been lost; or the vehicle has kept another value.
            try:
                kept = self.read(name)
            except NoReplyError:
                raise error from None
            if struct.pack(element.pytype, kept) != data[2:]:
                (sent,) = struct.unpack(element.pytype, data[2:])
                raise RefusedError(
                    f"writing {name}: the vehicle keeps {kept:g} in the place of {sent:g}"
                ) from None
            return kept
        if answer != data:
            raise _refusal(request, answer)
        return self._keep(link, element, answer[2:])

    def check_persistent(self, name: str) -> None:
        """Raise `CrazyflieError` unless a parameter exists and can be stored on the vehicle."""
        if not self._find(self._current_link(), name).is_persistent():
            raise RefusedError(f"{name} is not a persistent parameter")

    def store(self, name: str) -> None:
        """Store the present value of a persistent parameter, to survive a restart; blocks."""
        self._ask_persistent(name, MISC_PERSISTENT_STORE, "storing")

    def clear(self, name: str) -> None:
        """Forget the stored value of a persistent parameter; blocks."""
        self._ask_persistent(name, MISC_PERSISTENT_CLEAR, "clearing")

    def stored(self, name: str) -> PersistentParamState:
        """Return is_stored, default_value and stored_value (or None) of a parameter; blocks."""
        verb = "reading the state of"
        element, answer = self._ask_persistent(name, MISC_PERSISTENT_GET_STATE, verb, good=(0, 1))
        is_stored = answer[3] == 1
        values = struct.Struct("<" + element.pytype.lstrip("<") * (1 + is_stored))
        if len(answer) != 4 + values.size:
            raise RefusedError(f"{verb} {name}: the vehicle refuses it")
        default, *kept = values.unpack(answer[4:])
        return PersistentParamState(is_stored, default, kept[0] if kept else None)

    def _ask_persistent(self, name, command, verb, good=(0,)):
        # Returns the parameter and the answer, whose fourth byte is the status.
        link = self._current_link()
        element = self._find(link, name)
        if not element.is_persistent():
            raise RefusedError(f"{verb} {name}: it is not a persistent parameter")
        data = struct.pack("<BH", command, element.ident)
        answer = link.request(data, Request(CRTPPort.PARAM, MISC_CHANNEL, data, f"{verb} {name}"))
        if len(answer) < 4:
            raise RefusedError(f"{verb} {name}: the vehicle answers without a status")
        if answer[3] not in good:
            raise RefusedError(
                f"{verb} {name}: the vehicle refuses it ({os.strerror(answer[3])}, {answer[3]})"
            )
        return element, answer

    @staticmethod
    def _find(link: Link, name: str) -> ParamTocElement:
        known = elements(link.cflib.param.toc.toc)
        if name not in known:
            raise unknown_name("parameter", name, list(known))
        return known[name]

    @staticmethod
    def _pack(element: ParamTocElement, name: str, value: float) -> bytes:
        try:
            number = float(value) if _is_real(element) else int(value)
            if number != float(value):
                raise ValueError
            return struct.pack(element.pytype, number)
        except (ValueError, TypeError, OverflowError, struct.error):
            raise ValueRangeError(
                f"parameter {name} is a {element.ctype}; {value!r} does not fit"
            ) from None

    @staticmethod
    def _keep(link: Link, element: ParamTocElement, data: bytes) -> int | float:
        (value,) = struct.unpack(element.pytype, data)
        link.cflib.param.values.setdefault(element.group, {})[element.name] = str(value)
        return value


def _refusal(request, answer):
    return RefusedError(f"{request.what}: the vehicle answers: {answer[2:].hex() or 'nothing'}")


def _number(element, text):
    return float(text) if _is_real(element) else int(text)


def _is_real(element):
    # The last letter of a format of the module struct: half, single, double precision.
    return element.pytype[-1] in "efd"
