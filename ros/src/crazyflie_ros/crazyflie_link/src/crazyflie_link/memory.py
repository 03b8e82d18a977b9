"""Memories of the vehicle, such as those of trajectories and of lighthouse base stations."""

import struct
from collections.abc import Callable

from cflib.crazyflie.mem import CHAN_WRITE, MemoryElement, _WriteRequest
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import RefusedError
from crazyflie_link.link import Link
from crazyflie_link.request_reply import Request

_CHUNK = _WriteRequest.MAX_DATA_LENGTH


def find_memory(link: Link, kind: int, what: str) -> MemoryElement:
    """Return the vehicle's memory of one of cflib's types; `RefusedError` if it has none."""
    memories = link.cflib.mem.get_mems(kind)
    if not memories:
        raise RefusedError(f"the vehicle has no memory for {what}: update its firmware")
    return memories[0]


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
