"""Base of the parts of the firmware: their link, names, memories and limits of numbers."""

import copy
import math
import struct
from collections.abc import Callable
from typing import Self, TypeVar

from cflib.crazyflie.mem import CHAN_READ, CHAN_WRITE, MemoryElement, _WriteRequest
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import RefusedError, ValueRangeError
from crazyflie_link.limits import MIN_DURATION
from crazyflie_link.link import Link
from crazyflie_link.transmission import MaySend, Request

#: Numbers go over the link in single precision; a smaller one may arrive as 0.
SMALLEST_FLOAT, LARGEST_FLOAT = 1.2e-38, 3.4e38


def check_finite(what: str, *values: float) -> None:
    """Raise `ValueRangeError` unless all values are finite, in single precision, too."""
    for value in values:
        if not math.isfinite(value):
            raise ValueRangeError(f"{what}: {value} is not finite")
        if abs(value) > LARGEST_FLOAT:
            raise ValueRangeError(f"{what}: {value:g} is beyond +-{LARGEST_FLOAT:g}")


def check_positive(what: str, value: float) -> None:
    """Raise `ValueRangeError` unless the value is positive and finite, in single precision, too."""
    if not SMALLEST_FLOAT <= value <= LARGEST_FLOAT:
        raise ValueRangeError(
            f"{what} is {value:g}; expected a finite number above 0 ({SMALLEST_FLOAT:g} to "
            f"{LARGEST_FLOAT:g})"
        )


def check_duration(what: str, value: float) -> None:
    """Raise `ValueRangeError` unless a duration (s) or time scale is finite and long enough."""
    if not MIN_DURATION <= value <= LARGEST_FLOAT:
        raise ValueRangeError(
            f"{what} is {value:g}; expected a finite number of at least {MIN_DURATION:g}"
        )


def check_byte(what: str, value: int) -> None:
    """Raise `ValueRangeError` unless the value fits in a byte."""
    if not 0 <= value <= 255:
        raise ValueRangeError(f"{what} is {value}; expected 0 to 255")


class Subsystem:
    """A part of the firmware, reached over the vehicle's present link."""

    def __init__(self, current_link: Callable[[], Link]):
        self._current_link = current_link

    def guarded(self, may_send: MaySend) -> Self:
        """Return the same subsystem, over a link that is guarded; see `Link.guarded`."""
        guarded, current_link = copy.copy(self), self._current_link
        guarded._current_link = lambda: current_link().guarded(may_send)
        return guarded


Element = TypeVar("Element")


def elements(table: dict[str, dict[str, Element]]) -> dict[str, Element]:
    """Return the elements of one of cflib's tables: "group.name" -> element, sorted by name."""
    return {
        f"{group}.{name}": element
        for group, names in sorted(table.items())
        for name, element in sorted(names.items())
    }


_CHUNK = _WriteRequest.MAX_DATA_LENGTH


def find_memory(link: Link, kind: int, what: str) -> MemoryElement:
    """Return the vehicle's memory of one of cflib's types; `RefusedError` if it has none."""
    memories = link.cflib.mem.get_mems(kind)
    if not memories:
        raise RefusedError(f"the vehicle has no memory for {what}: update its firmware")
    return memories[0]


def has_memory(link: Link, number: int, address: int, what: str) -> bool:
    """Return whether a memory has an address; blocks."""
    where = struct.pack("<BI", number, address)
    request = Request(CRTPPort.MEM, CHAN_READ, where, f"looking for {what}")
    answer = link.request(where + b"\1", request)
    return len(answer) > 5 and answer[5] == 0


def write_memory(
    link: Link,
    number: int,
    begin: int,
    data: bytes,
    what: str,
    check: Callable[[], None] = lambda: None,
) -> None:
    """Write data from an address on; blocks.

    ``check()`` is called before every packet, and ends it by raising. Raises `RefusedError` if the
    memory has no such address.
    """
    # cflib's own writer never ends when a reply comes twice.
    for start in range(0, len(data), _CHUNK):
        check()
        where = struct.pack("<BI", number, begin + start)
        step = f"writing {what}, byte {begin + start}"
        request = Request(CRTPPort.MEM, CHAN_WRITE, where, step)
        answer = link.request(where + data[start : start + _CHUNK], request)
        status = answer[5] if len(answer) > 5 else 0
        if status:
            raise RefusedError(f"{step}: the vehicle refuses it (error {status})")
