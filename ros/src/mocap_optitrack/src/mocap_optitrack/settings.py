"""What mocap.yaml says, checked."""

import ipaddress
from dataclasses import dataclass

from crazyflie_utils.parameter_types import FRAME, TEXT, TOPIC

DEFAULT_PARENT_FRAME = "world"


@dataclass(frozen=True)
class RigidBody:
    """A rigid body that is to be published.

    Attributes
    ----------
    key : str
        The body's entry in ``rigid_bodies``: its number in the stream, or its name.
    name : str or None
        Its name on the server; None for a body that is found by its number.
    pose, pose2d : str or None
        Topics; None for none.
    child_frame_id : str or None
        tf frame of the body; None when tf is not to be told.
    parent_frame_id : str
        tf frame of the coordinates.
    """

    key: str
    name: str | None
    pose: str | None
    pose2d: str | None
    child_frame_id: str | None
    parent_frame_id: str

    @property
    def label(self) -> str:
        """What the body is called in messages."""
        return self.key if self.name in (None, self.key) else f"{self.key} ({self.name})"


_KINDS = {
    "name": TEXT,
    "pose": TOPIC,
    "pose2d": TOPIC,
    "child_frame_id": FRAME,
    "parent_frame_id": FRAME,
}


class RigidBodies:
    """Kind of the parameter ``rigid_bodies``.

    Attributes
    ----------
    unknown : list of str
        What was found but means nothing, such as "1/odom".
    """

    def __init__(self):
        self.unknown = []

    def __call__(self, value) -> list:
        """Return a list of `RigidBody`."""
        if not isinstance(value, dict) or not value:
            raise ValueError
        bodies = [self._body(str(key), entry) for key, entry in value.items()]
        _refuse_shared(bodies, "pose", "pose2d")
        _refuse_shared(bodies, "child_frame_id")
        _refuse_shared(bodies, "name")
        return bodies

    def __str__(self) -> str:
        """Return what is expected."""
        return (
            "a dictionary of number or name of a body: {pose, pose2d, child_frame_id, "
            "parent_frame_id}"
        )

    def _body(self, key, entry):
        if not isinstance(entry, dict):
            raise ValueError(f"{key} is {entry!r}; expected a dictionary")
        self.unknown += [f"{key}/{name}" for name in entry if name not in _KINDS]
        values = {}
        for name, kind in _KINDS.items():
            try:
                values[name] = kind(entry[name]) if name in entry else None
            except ValueError:
                raise ValueError(f"{key}/{name} is {entry[name]!r}; expected {kind}") from None
        if not (values["pose"] or values["pose2d"] or values["child_frame_id"]):
            raise ValueError(f"{key} has neither pose nor pose2d nor child_frame_id")
        if values["name"] is None and not key.isdecimal():
            values["name"] = key
        values["parent_frame_id"] = values["parent_frame_id"] or DEFAULT_PARENT_FRAME
        return RigidBody(key, **values)


def _refuse_shared(bodies, *attributes):
    owners = {}
    for body in bodies:
        for attribute in attributes:
            value = getattr(body, attribute)
            if value is None:
                continue
            if value in owners:
                raise ValueError(f"{owners[value]} and {body.key} share {attribute} {value!r}")
            owners[value] = body.key


@dataclass(frozen=True)
class NatNetSettings:
    """How to find a NatNet server, ``optitrack_config``.

    Attributes
    ----------
    server_address : str or None
        Host name or address; None to ask the multicast group and this machine.
    local_address : str or None
        Of this machine's interface that multicast frames come in by; None for the one
        that leads to the server.
    multicast_address : str or None
        Group of the frames, unless the server names one.
    command_port : int
        UDP port of the server.
    data_port : int
        UDP port of the group, unless the server names one.
    version : str or None
        Of the stream, such as "3.0": frames are then taken from the group without
        a word from the server.
    """

    server_address: str | None = None
    local_address: str | None = None
    multicast_address: str | None = None
    command_port: int = 1510
    data_port: int = 1511
    version: str | None = None


class Address:
    """An IPv4 address; with ``multicast``, that of a group."""

    def __init__(self, multicast: bool = False):
        self._multicast = multicast

    def __call__(self, value) -> str:
        """Return the address as text."""
        if not isinstance(value, str):
            raise ValueError
        address = ipaddress.IPv4Address(value)
        if address.is_multicast != self._multicast:
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        if self._multicast:
            return "a multicast address, 224.0.0.0 to 239.255.255.255"
        return "an IP address such as 192.168.1.20"


class StreamVersion:
    """Version of a NatNet stream: "3.1", the number 3.1, or a list such as [3, 1, 0, 0]."""

    def __call__(self, value) -> str:
        """Return it as text such as "3.1"."""
        parts = value if isinstance(value, list) else str(value).split(".")
        if isinstance(value, bool) or not 2 <= len(parts) <= 4:
            raise ValueError
        major, minor = (int(part) for part in parts[:2])
        if major < 2 or minor < 0:
            raise ValueError
        return f"{major}.{minor}"

    def __str__(self) -> str:
        """Return what is expected."""
        return "a NatNet version from 2.0 on, such as 3.1 or [3, 1, 0, 0]"
