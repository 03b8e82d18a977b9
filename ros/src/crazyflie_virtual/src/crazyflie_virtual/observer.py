"""The true pose as a datagram, sent to local observers.

Motion capture sees the vehicle this way, and tests do. The time is that of the
machine's monotonic clock, which all its processes share.
"""

import struct
from typing import NamedTuple

from crazyflie_model.angles import Quaternion, Triple

DEFAULT_PORT = 19800

_MAGIC = b"vcf1"
_FORM = struct.Struct("<4sH32s14d")


class Observation(NamedTuple):
    """The truth about a vehicle at some moment."""

    #: body_id, name: those of the vehicle; the name has at most 31 bytes.
    body_id: int
    name: str
    time: float  #: Time of the machine's monotonic clock (s).
    #: position, velocity: m and m/s, fixed frame.
    position: Triple
    velocity: Triple
    quaternion: Quaternion  #: (x, y, z, w), body to fixed frame.
    rates: Triple  #: Body rates, rad/s.

    def encode(self) -> bytes:
        """Return the observation as a datagram."""
        return _FORM.pack(
            _MAGIC,
            self.body_id,
            self.name.encode()[:31],
            self.time,
            *self.position,
            *self.velocity,
            *self.quaternion,
            *self.rates,
        )


def decode(datagram: bytes) -> Observation | None:
    """Return the observation in a datagram; None when it holds none."""
    if len(datagram) != _FORM.size or not datagram.startswith(_MAGIC):
        return None
    _, body_id, name, time, *numbers = _FORM.unpack(datagram)
    return Observation(
        body_id,
        name.rstrip(b"\0").decode("utf-8", "replace"),
        time,
        tuple(numbers[0:3]),
        tuple(numbers[3:6]),
        tuple(numbers[6:10]),
        tuple(numbers[10:13]),
    )
