"""Parameters of the firmware: names, types, values."""

import struct

from cflib.crazyflie.param import ParamTocElement
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_py.errors import RefusedError, ValueRangeError, unknown_name
from crazyflie_py.link import CurrentLink, Link

_READ_CHANNEL, _WRITE_CHANNEL = 1, 2


class Parameters:
    """The parameters of a vehicle; all were read when the link was set up.

    Parameters
    ----------
    current_link : callable
        Returns the `Link`, or raises `LinkLostError`.
    """

    def __init__(self, current_link: CurrentLink):
        self._current_link = current_link

    def types(self) -> dict[str, tuple[str, bool]]:
        """Return the parameters: "group.name" -> (C type, whether it can be written)."""
        toc = self._current_link().cflib.param.toc.toc
        return {
            f"{group}.{name}": (element.ctype, element.access == ParamTocElement.RW_ACCESS)
            for group in sorted(toc)
            for name, element in sorted(toc[group].items())
        }

    def values(self) -> dict[str, int | float]:
        """Return the values as last read or written: "group.name" -> int or float."""
        param = self._current_link().cflib.param
        result = {}
        for group, names in sorted(param.toc.toc.items()):
            for name, element in sorted(names.items()):
                text = param.values.get(group, {}).get(name)
                if text is not None:
                    result[f"{group}.{name}"] = _number(element, text)
        return result

    def read(self, name: str) -> int | float:
        """Ask the vehicle for a parameter, such as "ring.effect"; blocks.

        Raises
        ------
        CrazyflieError
            There is no such parameter, or no reply.
        """
        link = self._current_link()
        element = self._find(link, name)
        request = struct.pack("<H", element.ident)
        answer = link.ask(request, CRTPPort.PARAM, _READ_CHANNEL, request, f"reading {name}")
        # Identifier, status, value.
        if len(answer) < 3 or answer[2] != 0:
            raise RefusedError(f"reading {name}: the vehicle says {answer[2:].hex() or 'nothing'}")
        return self._keep(link, element, answer[3:])

    def write(self, name: str, value: int | float) -> int | float:
        """Set a parameter and return the value that the vehicle confirms; blocks.

        Raises
        ------
        CrazyflieError
            There is no such parameter, it cannot be written, the value does not
            fit its type, or no reply.
        """
        link = self._current_link()
        element = self._find(link, name)
        if element.access != ParamTocElement.RW_ACCESS:
            raise RefusedError(f"parameter {name} can only be read")
        ident = struct.pack("<H", element.ident)
        request = ident + self._pack(element, name, value)
        answer = link.ask(request, CRTPPort.PARAM, _WRITE_CHANNEL, ident, f"writing {name}")
        if len(answer) != len(request):
            raise RefusedError(f"writing {name}: the vehicle says {answer[2:].hex() or 'nothing'}")
        return self._keep(link, element, answer[2:])

    @staticmethod
    def _find(link: Link, name: str) -> ParamTocElement:
        toc = link.cflib.param.toc.toc
        group, _, rest = name.partition(".")
        try:
            return toc[group][rest]
        except KeyError:
            known = [f"{g}.{n}" for g, names in toc.items() for n in names]
            raise unknown_name("parameter", name, sorted(known)) from None

    @staticmethod
    def _pack(element: ParamTocElement, name: str, value: float) -> bytes:
        is_real = element.pytype[-1] in "efd"
        try:
            number = float(value) if is_real else int(value)
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


def _number(element, text):
    return float(text) if element.pytype[-1] in "efd" else int(text)
