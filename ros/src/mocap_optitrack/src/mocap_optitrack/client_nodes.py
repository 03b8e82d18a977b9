"""Nodes with the names of other packages for motion capture: each publishes all visible bodies.

Names, parameters, topics and frames are those of vicon_bridge, vrpn_client_ros and
ros_vrpn_client, for launch files that start these.
"""

import re
from collections.abc import Mapping
from typing import Any

from geometry_msgs.msg import TransformStamped
from typing_extensions import override

from crazyflie_utils import NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, PORT, TEXT, ListOf
from mocap_optitrack.bodies import RigidBody
from mocap_optitrack.frames import Frame
from mocap_optitrack.mocap_node import MocapNode, transform_of
from mocap_optitrack.mocap_parameters import MocapParameters, NatNetParameters

_VRPN_PORT = 3883


class ClientNode(MocapNode):
    """A `MocapNode` without a list of bodies."""

    @override
    def on_frame(self, frame: Frame) -> None:
        for name in (each.name for each in frame.bodies):
            if name is not None and name not in self._known:
                outputs = self._known[name] = self.outputs(name)
                if outputs is not None:
                    self.add_body(RigidBody(key=name, own_name=name, **outputs))
        super().on_frame(frame)

    def outputs(self, name: str) -> Mapping[str, Any] | None:
        """Return how a body is published, as `RigidBody`; None if it is not."""
        raise NotImplementedError

    def use(self, backend: str, hostname: str) -> None:
        """Connect to a system when callbacks are registered."""
        self._known: dict[str, Mapping[str, Any] | None] = {}
        # mypy treats each default as a missing argument.
        self._parameters = MocapParameters(  # type: ignore[call-arg]
            natnet=NatNetParameters(),  # type: ignore[call-arg]
            backend=backend,
            hostname=hostname,
        )


class VrpnClientParameters(Parameters):
    """Parameters of `VrpnClientNode`."""

    server: str = parameter(TEXT, "host name or address of the VRPN server", "localhost")
    port: int = parameter(PORT, "TCP port of the server", _VRPN_PORT)
    frame_id: str = parameter(FRAME, "frame of the coordinates", "world")
    broadcast_tf: bool = parameter(BOOLEAN, "also publish poses on /tf", True)
    trackers: tuple[str, ...] | None = parameter(
        ListOf(TEXT), "trackers to publish; all by default", None
    )


class VrpnClientNode(ClientNode):
    """vrpn_client_node of vrpn_client_ros: ``~TRACKER/pose`` and frame ``TRACKER``."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._client = handle.load(VrpnClientParameters)
        self.use("vrpn", f"{self._client.server}:{self._client.port}")

    @override
    def outputs(self, name: str) -> Mapping[str, Any] | None:
        client = self._client
        if client.trackers and name not in client.trackers:
            return None
        return {
            "pose": f"{legal(name)}/pose",
            "parent_frame_id": client.frame_id,
            "child_frame_id": name if client.broadcast_tf else None,
        }


class RosVrpnClientParameters(Parameters):
    """Parameters of `RosVrpnClientNode`."""

    ip: str = parameter(TEXT, "host name or address of the VRPN server", "localhost")
    port: int = parameter(PORT, "TCP port of the server", _VRPN_PORT)
    frame_id: str = parameter(FRAME, "frame of the coordinates", "world")
    child_frame_id: str = parameter(
        FRAME, "frame of the tracker; its last part is the tracker's name", "Tracker0"
    )


class RosVrpnClientNode(ClientNode):
    """ros_vrpn_client: the frame of one tracker."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._client = handle.load(RosVrpnClientParameters)
        self.use("vrpn", f"{self._client.ip}:{self._client.port}")

    @override
    def outputs(self, name: str) -> Mapping[str, Any] | None:
        frame = self._client.child_frame_id
        if name.strip("/") not in (frame, frame.rpartition("/")[2]):
            return None
        return {"parent_frame_id": self._client.frame_id, "child_frame_id": frame}


class ViconBridgeParameters(Parameters):
    """Parameters of `ViconBridgeNode`."""

    datastream_hostport: str = parameter(
        TEXT, "host name or address of the computer with Vicon's software, and port", "vicon:801"
    )
    tf_ref_frame_id: str = parameter(FRAME, "frame of the coordinates", "world")


class ViconBridgeNode(ClientNode):
    """vicon_bridge: ``vicon/SUBJECT/SUBJECT``, a TransformStamped and a frame.

    The package that connects to Vicon tells subjects and not their segments: the segment has the
    name of its subject, as it has by default.
    """

    pose_type = TransformStamped

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._client = handle.load(ViconBridgeParameters)
        self.use("vicon", self._client.datastream_hostport)

    @override
    def outputs(self, name: str) -> Mapping[str, Any] | None:
        return {
            "pose": self._handle.resolve(f"vicon/{legal(name)}/{legal(name)}"),
            "parent_frame_id": self._client.tf_ref_frame_id,
            "child_frame_id": f"vicon/{name}/{name}",
        }

    pose_message = staticmethod(transform_of)


def legal(name: str) -> str:
    """Return a name that a topic may have."""
    text = re.sub(r"[^\w]", "_", name, flags=re.ASCII)
    return text if text[:1].isalpha() else f"n{text}"
