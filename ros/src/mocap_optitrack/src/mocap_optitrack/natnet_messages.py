"""NatNet messages: bytes to values, with the decoders of the natnet package.

natnet's own client is not used: its receiving threads end at the first datagram
they cannot decode, it hides the frequency of the server's clock, without which time stamps are
useless, and it needs the server's address, which multicast does not.
"""

import math
import struct
from typing import NamedTuple

from natnet import DataDescriptions, DataFrame, NatNetClient, NatNetError, Version
from natnet import ServerInfo as _Info
from natnet.packet_buffer import PacketBuffer

from mocap_optitrack.frames import Frame, SeenBody

CONNECT = NatNetClient.NAT_CONNECT
SERVER_INFO = NatNetClient.NAT_SERVERINFO
REQUEST_MODEL = NatNetClient.NAT_REQUEST_MODELDEF
MODEL = NatNetClient.NAT_MODELDEF
FRAME = NatNetClient.NAT_FRAMEOFDATA
KEEP_ALIVE = NatNetClient.NAT_KEEPALIVE

_HEADER = struct.Struct("<HH")

_INFO_SIZE = 264  #: Bytes of a server's name and versions, which natnet decodes.

#: Fields that servers add from 3.0 on: ticks per second of their clock, data port, whether they
#: send to a group, and the group.
_CONNECTION = struct.Struct("<QHB4B")


class DecodeError(Exception):
    """A datagram does not match its header."""


class ServerInfo(NamedTuple):
    """A server's answer to `CONNECT`."""

    #: name, version: Name of the application, such as "Motive"; version of the stream, such as
    #: "3.1".
    name: str
    version: str
    clock_frequency: int | None = None  #: Ticks of its clock per second.
    is_multicast: bool | None = None  #: Whether it sends to a group and not to each client.
    #: multicast_address, data_port: The group.
    multicast_address: str | None = None
    data_port: int | None = None


def request(number: int, text: str = "") -> bytes:
    """Return a message to a server."""
    payload = text.encode() + b"\0"
    return _HEADER.pack(number, len(payload)) + payload


def split(datagram: bytes) -> tuple[int, bytes]:
    """Return number and payload of a message, or raise `DecodeError`."""
    if len(datagram) < _HEADER.size:
        raise DecodeError(f"a datagram of {len(datagram)} bytes is not a NatNet message")
    number, length = _HEADER.unpack_from(datagram)
    payload = datagram[_HEADER.size :]
    if length != len(payload):
        raise DecodeError(f"a message of {len(payload)} bytes should have {length} by its header")
    return number, payload


def read_server_info(payload: bytes) -> ServerInfo:
    """Return the content of a `SERVER_INFO` message, or raise `DecodeError`."""
    info = _decode(_Info, payload, None)
    version = str(info.nat_net_protocol_version.truncate(2))
    if len(payload) < _INFO_SIZE + _CONNECTION.size:
        return ServerInfo(info.application_name, version)
    frequency, port, is_multicast, *group = _CONNECTION.unpack_from(payload, _INFO_SIZE)
    address = ".".join(map(str, group)) if any(group) else None
    return ServerInfo(
        info.application_name, version, frequency or None, bool(is_multicast), address, port or None
    )


def read_names(payload: bytes, version: str) -> dict[int, str]:
    """Return number to name of all rigid bodies in a `MODEL` message, or raise `DecodeError`."""
    model = _decode(DataDescriptions, payload, version)
    return {body.id_num: body.name for body in model.rigid_bodies}


def read_frame(
    payload: bytes, version: str, clock_frequency: int | None, names: dict[int, str], arrival: float
) -> Frame:
    """Return the content of a `FRAME` message of a stream's version, or raise `DecodeError`.

    ``clock_frequency`` is in ticks of the server's clock per second; without it, or before version
    3.0, the frame's one software time stamp stands for exposure and sending. ``names`` are those of
    rigid bodies by number; ``arrival`` is s of the local clock.
    """
    frame = _decode(DataFrame, payload, version)
    stamps = frame.suffix
    exposure = sent = stamps.timestamp
    if clock_frequency and stamps.stamp_transmit:
        sent = stamps.stamp_transmit / clock_frequency
        # Without hardware synchronisation the time of exposure is missing.
        first = stamps.stamp_camera_mid_exposure or stamps.stamp_data_received
        exposure = (first or stamps.stamp_transmit) / clock_frequency
    if not math.isfinite(sent):
        raise DecodeError(f"a frame of {sent:g} s has no time")
    bodies = tuple(
        SeenBody(body.id_num, names.get(body.id_num), body.pos, body.rot, _is_tracked(body))
        for body in frame.rigid_bodies
    )
    return Frame(exposure, sent, arrival, bodies, points=_unlabelled(frame))


def _unlabelled(frame):
    # Motive sends them twice: without numbers, and flagged among the labelled ones. Others send
    # only the second.
    if frame.unlabeled_marker_pos:
        return frame.unlabeled_marker_pos
    labelled = frame.labeled_markers or ()
    return tuple(marker.pos for marker in labelled if marker.param and marker.unlabeled)


def _is_tracked(body):
    if body.tracking_valid is not None:
        return body.tracking_valid
    # Before version 2.6 a body that is not tracked is all zeros.
    return any(body.pos) or any(body.rot)


class _Buffer(PacketBuffer):
    # natnet reads empty strings beyond the end, and allocates room for any count: a broken datagram
    # would take hours, or all memory.

    def read_string(self, *args, **kwargs):
        self._require(1)
        return super().read_string(*args, **kwargs)

    def read_float32_array(self, count):
        self._require(4 * count)
        return super().read_float32_array(count)

    def _require(self, size):
        if self.pointer + size > len(self.data):
            raise ValueError(f"{size} bytes follow byte {self.pointer}")


def _decode(message_type, payload, version):
    parsed = None if version is None else Version.from_str(version)
    try:
        return message_type.read_from_buffer(_Buffer(payload), parsed)
    except (struct.error, ValueError, IndexError, NatNetError) as error:
        what = f"{message_type.__name__} of NatNet {version}" if version else message_type.__name__
        raise DecodeError(f"cannot decode a {what} of {len(payload)} bytes: {error}") from None
