"""Messages of a NatNet server, as bytes.

Versions 2.9, 3.1 and 4.1 of the bit stream. Numbers are little-endian; a message
begins with its number and the length of what follows, 16 bits each.
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

from crazyflie_model.angles import Quaternion, Triple

CONNECT, SERVER_INFO = 0, 1
REQUEST_MODEL, MODEL = 4, 5
FRAME = 7
KEEP_ALIVE = 10
ECHO_REQUEST, ECHO_RESPONSE = 12, 13
UNRECOGNIZED = 100

VERSIONS = ("2.9", "3.1", "4.1")

CLOCK_FREQUENCY = 1_000_000_000  #: Ticks per second of the server's clock.

_RIGID_BODY = 1
_TRACKED = 1
_NO_PARENT = -1
_NO_MARKERS = struct.pack("<i", 0)
_POINT_CLOUD_SOLVED, _UNLABELLED = 0x02, 0x10
_MARKER_SIZE = 0.0095  #: Diameter of a marker, m.
_HEADER = struct.Struct("<HH")


class StreamedBody(NamedTuple):
    """A rigid body in a frame."""

    body_id: int
    name: str
    position: Triple  #: m.
    quaternion: Quaternion  #: (x, y, z, w).
    is_tracked: bool  #: Whether it is tracked; otherwise the pose is an old one.


def parse(datagram: bytes) -> tuple[int, bytes] | None:
    """Return number and payload of a message; None if the datagram is not a message."""
    if len(datagram) < _HEADER.size:
        return None
    number, _ = _HEADER.unpack_from(datagram)
    return number, datagram[_HEADER.size :]


class Encoder:
    """Writes the messages of one version, of `VERSIONS`."""

    def __init__(self, version: str):
        self._parts = tuple(int(part) for part in version.split("."))

    def server_info(self, name: str, data_port: int, multicast_address: str | None) -> bytes:
        """Return the answer to `CONNECT`; without a multicast address for unicast."""
        group = multicast_address or "0.0.0.0"
        payload = struct.pack(
            "<256s4B4BQHB4B",
            name.encode()[:255],
            *(1, 0, 0, 0),
            *(*self._parts, 0, 0),
            CLOCK_FREQUENCY,
            data_port,
            multicast_address is not None,
            *(int(part) for part in group.split(".")),
        )
        return _message(SERVER_INFO, payload)

    def model(self, bodies: Sequence[StreamedBody]) -> bytes:
        """Return the answer to `REQUEST_MODEL`: names and numbers of the bodies."""
        payload = struct.pack("<i", len(bodies))
        for body in bodies:
            description = body.name.encode() + b"\0"
            description += struct.pack("<ii3f", body.body_id, _NO_PARENT, 0.0, 0.0, 0.0)
            if self._parts >= (3, 0):
                description += _NO_MARKERS
            payload += struct.pack("<i", _RIGID_BODY) + self._sized(description)
        return _message(MODEL, payload)

    def frame(
        self,
        number: int,
        bodies: Sequence[StreamedBody],
        exposure: float,
        received: float,
        sent: float,
        markers: Sequence[Triple] = (),
    ) -> bytes:
        """Return a frame.

        Middle of the cameras' exposure, arrival of their data and dispatch of the frame are s of
        the server's clock. ``markers`` do not belong to a rigid body, m; Motive sends them twice:
        as other markers, and flagged as unlabelled among the labelled ones.
        """
        others = [struct.pack("<3f", *marker) for marker in markers]
        flagged = [self._unlabelled(*each) for each in enumerate(markers, 1)]
        # Marker sets, other markers, rigid bodies, skeletons, assets from 4.1 on, labelled
        # markers, force plates, and devices from 2.11 on.
        sections = [[], others, [self._rigid_body(body) for body in bodies], []]
        sections += [[]] * (self._parts >= (4, 1)) + [flagged, []]
        sections += [[]] * (self._parts >= (2, 11))
        payload = struct.pack("<i", number)
        for items in sections:
            payload += struct.pack("<i", len(items)) + self._sized(b"".join(items))
        payload += struct.pack("<IId", 0, 0, exposure)
        if self._parts >= (3, 0):
            stamps = (round(s * CLOCK_FREQUENCY) for s in (exposure, received, sent))
            payload += struct.pack("<3Q", *stamps)
        if self._parts >= (4, 1):
            # Precision time stamp, in seconds and their fraction: zeros without PTP.
            payload += struct.pack("<II", 0, 0)
        return _message(FRAME, payload + struct.pack("<hI", 0, 0))

    def _sized(self, content):
        size = struct.pack("<i", len(content)) if self._parts >= (4, 1) else b""
        return size + content

    def _unlabelled(self, number, position):
        flags = _POINT_CLOUD_SOLVED | _UNLABELLED
        data = struct.pack("<i4fH", number, *position, _MARKER_SIZE, flags)
        # The residual.
        return data + (struct.pack("<f", 0.0) if self._parts >= (3, 0) else b"")

    def _rigid_body(self, body):
        data = struct.pack("<i7f", body.body_id, *body.position, *body.quaternion)
        if self._parts < (3, 0):
            data += _NO_MARKERS
        return data + struct.pack("<fh", 0.0, _TRACKED if body.is_tracked else 0)


def echo(payload: bytes, time: float) -> bytes:
    """Return the answer to `ECHO_REQUEST`: the client's clock and the server's (s)."""
    return _message(ECHO_RESPONSE, payload[:8] + struct.pack("<Q", round(time * CLOCK_FREQUENCY)))


def unrecognized() -> bytes:
    """Return the answer to a request that the server does not know."""
    return _message(UNRECOGNIZED, b"")


def _message(number, payload):
    return _HEADER.pack(number, len(payload)) + payload
