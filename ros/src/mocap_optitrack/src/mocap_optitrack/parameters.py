"""Parameters of mocap_node, as mocap.yaml has them."""

import ipaddress
from collections.abc import Iterator
from dataclasses import dataclass

from typing_extensions import override

from crazyflie_utils.messages import shortened, shown
from crazyflie_utils.parameters.declaration import ParameterError, Parameters, group, parameter
from crazyflie_utils.parameters.types import (
    FRAME,
    TEXT,
    TIME_STEP,
    TOPIC,
    Integer,
    ParameterType,
    Text,
)
from mocap_optitrack.axes import UP_AXES
from mocap_optitrack.library_source import SYSTEMS

NATNET = "natnet"
"""Backend of OptiTrack; the others are `library_source.SYSTEMS`."""

_PORT = Integer(1, 65535)


class RigidBodyParameters(Parameters):
    """An entry of ``rigid_bodies``: how a rigid body is published."""

    pose: str | None = parameter(
        TOPIC, "topic; a relative name is below the node's: `/mocap_node/Robot_1/pose`", None
    )
    pose2d: str | None = parameter(TOPIC, "topic, likewise", None)
    child_frame_id: str | None = parameter(FRAME, "tf frame of the body", None)
    parent_frame_id: str = parameter(FRAME, "tf frame of the coordinates", "world")
    name: str | None = parameter(
        TEXT,
        "name on the server, if it is not the key; without it a number is a streaming ID",
        None,
    )


@dataclass(frozen=True)
class RigidBody:
    """A rigid body that is to be published.

    Attributes
    ----------
    key : str
        The body's entry in ``rigid_bodies``: its number in the stream, or its name.
    parameters : RigidBodyParameters
        Its topics and frames.
    """

    key: str
    parameters: RigidBodyParameters

    @property
    def name(self) -> str | None:
        """Name on the server; None for a body that is found by its number."""
        if self.parameters.name is None and not self.key.isdecimal():
            return self.key
        return self.parameters.name

    @property
    def label(self) -> str:
        """What the body is called in messages."""
        return self.key if self.name in (None, self.key) else f"{self.key} ({self.name})"


@dataclass(frozen=True)
class RigidBodies:
    """The rigid bodies that are to be published.

    Attributes
    ----------
    bodies : list of RigidBody
        At least one.
    unknown : list of str
        Entries that have no meaning, such as "1/odom".
    """

    bodies: list[RigidBody]
    unknown: list[str]


class RigidBodyDictionary(ParameterType):
    """The dictionary ``rigid_bodies``; a refusal names all that is wrong with it."""

    label = "dictionary"

    @override
    def __call__(self, value: object) -> RigidBodies:
        if not isinstance(value, dict) or not value:
            raise ValueError
        known = {declaration.name for declaration in RigidBodyParameters.declarations()}
        bodies, unknown, complaints = [], [], []
        for key, entry in value.items():
            label = shortened(str(key))
            if not isinstance(entry, dict):
                complaints.append(f"{label} is {shown(entry)}; expected a dictionary")
                continue
            unknown += [f"{label}/{shortened(str(name))}" for name in entry if name not in known]
            values = {name: entry[name] for name in entry if name in known}
            try:
                parameters = RigidBodyParameters.from_mapping(values, f"{label}/")
            except ParameterError as error:
                complaints += error.complaints
                continue
            bodies.append(RigidBody(str(key), parameters))
            if not (parameters.pose or parameters.pose2d or parameters.child_frame_id):
                complaints.append(f"{label} has neither pose nor pose2d nor child_frame_id")
        complaints += _shared("topic", [(b, t) for b in bodies for t in _topics(b)])
        complaints += _shared("child_frame_id", [(b, b.parameters.child_frame_id) for b in bodies])
        complaints += _shared("name", [(b, b.name) for b in bodies])
        if complaints:
            raise ValueError("; ".join(complaints))
        return RigidBodies(bodies, unknown)

    def __str__(self) -> str:
        """Return what is expected."""
        return (
            "a dictionary of number or name of a body: {pose, pose2d, child_frame_id, "
            "parent_frame_id}"
        )


def _topics(body):
    return body.parameters.pose, body.parameters.pose2d


def _shared(what, owned):
    owners: dict[str, str] = {}
    for body, value in owned:
        if value in owners:
            yield f"{owners[value]} and {body.key} share {what} {shown(value)}"
        elif value is not None:
            owners[value] = body.key


@dataclass(frozen=True)
class Address(ParameterType):
    """An IPv4 address; with ``multicast``, that of a group."""

    multicast: bool = False
    label = "string"

    @property
    def range(self) -> str:  # type: ignore[override]
        """The addresses of groups."""
        return "224.0.0.0 to 239.255.255.255" if self.multicast else ""

    @override
    def __call__(self, value: object) -> str:
        if not isinstance(value, str):
            raise ValueError
        address = ipaddress.IPv4Address(value)
        if address.is_multicast != self.multicast:
            raise ValueError
        return value

    def __str__(self) -> str:
        """Return what is expected."""
        if self.multicast:
            return f"a multicast address, {self.range}"
        return "an IP address such as 192.168.1.20"


class StreamVersion(ParameterType):
    """Version of a NatNet stream, as text such as "3.1"."""

    label = "string, float or list"
    range = ">= 2.0"

    @override
    def __call__(self, value: object) -> str:
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


class NatNetParameters(Parameters):
    """How to find a NatNet server, ``optitrack_config``."""

    server_address: str | None = parameter(
        TEXT,
        "natnet: host name or address of the server, the only one that datagrams are taken from. "
        "Without it the multicast group and this machine are asked, and the first answer decides",
        None,
    )
    local_address: str | None = parameter(
        Address(),
        "natnet: address of this machine in the cameras' network, the only one that datagrams are "
        "received at. Without it, that of the interface that leads to the server",
        None,
    )
    multicast_address: str | None = parameter(
        Address(multicast=True),
        "natnet: group that frames are sent to, unless the server names one",
        None,
    )
    command_port: int = parameter(_PORT, "natnet: UDP port of the server", 1510)
    data_port: int = parameter(
        _PORT, "natnet: UDP port of the group, unless the server names one", 1511
    )
    version: str | None = parameter(
        StreamVersion(),
        "natnet: version of the stream, such as 3.1 or [3, 1, 0, 0]. With it, and a group, frames "
        "are taken from the group even if no server answers",
        None,
    )


class LibraryParameters(Parameters):
    """How to find a server of another system, ``motioncapture_config``."""

    hostname: str | None = parameter(
        TEXT,
        "the other systems, which require it: host name or address of the server; for VRPN also "
        "with a port, `vicon:3884`",
        None,
    )


class MocapParameters(Parameters):
    """Parameters of `MocapNode`."""

    rigid_bodies: RigidBodies = parameter(RigidBodyDictionary(), "the bodies to publish, see below")
    backend: str = parameter(Text((NATNET, *SYSTEMS)), "the system", NATNET)
    up_axis: str = parameter(
        Text(UP_AXES), "the axis that points up in the system's stream, see [Frames](#frames)", "z"
    )
    stale_after: float = parameter(
        TIME_STEP,
        "poses that are older on arrival are dropped, longer gaps are reported",
        0.2,
        live=True,
    )
    natnet: NatNetParameters = group(NatNetParameters, "optitrack_config")
    library: LibraryParameters = group(LibraryParameters, "motioncapture_config")

    @override
    def complaints(self) -> Iterator[str]:
        if self.backend != NATNET and self.library.hostname is None:
            yield (
                "parameter motioncapture_config/hostname is not set; expected the host name or "
                f"address of the {self.backend} server"
            )
