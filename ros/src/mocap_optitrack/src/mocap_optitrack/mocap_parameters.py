"""Parameters of mocap_node, as mocap.yaml has them."""

import ipaddress
from collections.abc import Iterator
from functools import partial

from typing_extensions import override

from crazyflie_utils.parameters.declaration import Parameters, group, parameter
from crazyflie_utils.parameters.types import (
    DURATION,
    PORT,
    TEXT,
    TIME_STEP,
    Converted,
    ListOf,
    Number,
    Text,
)
from crazyflie_utils.text import shortened
from mocap_optitrack.bodies import (
    RIGID_BODIES,
    SINGLE_MARKERS,
    Body,
    SingleMarker,
    shared_outputs,
)
from mocap_optitrack.frames import UP_AXES
from mocap_optitrack.library_source import SYSTEMS

NATNET = "natnet"  #: Backend of OptiTrack; the others are `library_source.SYSTEMS`.


def _ip_address(value, is_group=False):
    address = ipaddress.IPv4Address(TEXT(value))
    if address.is_multicast != is_group:
        raise ValueError
    return value


ADDRESS = Converted(_ip_address, "an IP address such as 192.168.1.20")
_GROUPS = "224.0.0.0 to 239.255.255.255"
GROUP = Converted(
    partial(_ip_address, is_group=True), f"a multicast address, {_GROUPS}", range=_GROUPS
)


def _stream_version(value):
    parts = value if isinstance(value, list) else str(value).split(".")
    if isinstance(value, bool) or not 2 <= len(parts) <= 4:
        raise ValueError
    major, minor = (int(part) for part in parts[:2])
    if major < 2 or minor < 0:
        raise ValueError
    return f"{major}.{minor}"


#: Version of a NatNet stream, as text such as "3.1".
STREAM_VERSION = Converted(
    _stream_version,
    "a NatNet version from 2.0 on, such as 3.1 or [3, 1, 0, 0]",
    "string, float or list",
    range=">= 2.0",
)


class NatNetParameters(Parameters):
    """Connection to a NatNet server, ``optitrack_config``."""

    server_address: str | None = parameter(
        TEXT,
        "natnet: host name or address of the server; datagrams of others are ignored. Without it "
        "the multicast group and this machine are asked, and the first answer is used",
        None,
    )
    local_address: str | None = parameter(
        ADDRESS,
        "natnet: address of this machine in the cameras' network, the only one on which "
        "datagrams are received. Without it, that of the interface that leads to the server",
        None,
    )
    multicast_address: str | None = parameter(
        GROUP,
        "natnet: group to which frames are sent, unless the server names one",
        None,
    )
    command_port: int = parameter(PORT, "natnet: UDP port of the server", 1510)
    data_port: int = parameter(
        PORT, "natnet: UDP port of the group, unless the server names one", 1511
    )
    version: str | None = parameter(
        STREAM_VERSION,
        "natnet: version of the stream, such as 3.1 or [3, 1, 0, 0]. With it, and a group, frames "
        "are taken from the group even if no server answers",
        None,
    )


class MocapParameters(Parameters):
    """Parameters of `MocapNode`."""

    rigid_bodies: list[Body] | None = parameter(
        RIGID_BODIES,
        "the bodies to publish, see below; required without `single_markers`",
        None,
    )
    single_markers: list[Body] | None = parameter(
        SINGLE_MARKERS,
        "the vehicles with one marker each, see [Single markers](#single-markers)",
        None,
    )
    hold_time: float = parameter(
        DURATION,
        "time in flight after which an unseen vehicle with one marker is lost, until it rests on "
        "the ground",
        0.5,
    )
    backend: str = parameter(Text((NATNET, *SYSTEMS)), "the system", NATNET)
    up_axis: str = parameter(
        Text(UP_AXES), "the axis that points up in the system's stream, see [Frames](#frames)", "z"
    )
    stale_after: float = parameter(
        TIME_STEP,
        "largest age of poses on arrival, older ones are dropped; longer gaps are reported",
        0.2,
        live=True,
    )
    rate_limits: tuple[float, float] | None = parameter(
        ListOf(Number("Hz", minimum=0.0), 2),
        "lowest and highest number of frames per second; outside, the diagnostics warn",
        None,
    )
    natnet: NatNetParameters = group(NatNetParameters, "optitrack_config")
    hostname: str | None = parameter(
        TEXT,
        "the other systems, which require it: host name or address of the server; for VRPN also "
        "with a port, `vicon:3884`",
        None,
        "motioncapture_config/hostname",
    )

    @property
    def bodies(self) -> list[Body]:
        """All published bodies."""
        return [*(self.rigid_bodies or ()), *(self.single_markers or ())]

    @property
    def markers(self) -> list[SingleMarker]:
        """Those of `bodies` that have one marker."""
        return [body for body in self.bodies if isinstance(body, SingleMarker)]

    @property
    def unknown(self) -> list[str]:
        """Unknown entries, such as "rigid_bodies/1/odom"."""
        return [
            f"{body.dictionary}/{shortened(body.key)}/{name}"
            for body in self.bodies
            for name in body.unknown
        ]

    @override
    def complaints(self) -> Iterator[str]:
        if not self.bodies:
            yield "parameter rigid_bodies is not set; expected it, or single_markers"
        keys = [body.key for body in self.bodies]
        for key in dict.fromkeys(key for key in keys if keys.count(key) > 1):
            yield f"parameters rigid_bodies/{key} and single_markers/{key}; expected one of them"
        yield from shared_outputs(self.bodies)
        if self.backend != NATNET and self.hostname is None:
            yield (
                "parameter motioncapture_config/hostname is not set; expected the host name or "
                f"address of the {self.backend} server"
            )
