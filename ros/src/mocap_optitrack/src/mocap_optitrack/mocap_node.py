"""ROS interface of a motion capture system."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    Pose,
    Pose2D,
    PoseStamped,
    Quaternion,
    TransformStamped,
    Vector3,
)
from std_msgs.msg import Header

from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TEXT, Integer, Number, Text
from mocap_optitrack.axes import UP_AXES, heading
from mocap_optitrack.health import ERROR, Health
from mocap_optitrack.library_source import SYSTEMS, LibrarySource
from mocap_optitrack.natnet_source import NatNetSource
from mocap_optitrack.settings import Address, NatNetSettings, RigidBodies, StreamVersion
from mocap_optitrack.source import Receiver
from mocap_optitrack.tracker import Tracker

_NATNET = "natnet"

_REPORT_PERIOD = 1.0
"""Of the diagnostics, s; REP 107 wants one report a second."""

_REPEAT = 5.0
"""The same warning comes at most this often, s."""

_PORT = Integer(1, 65535)
_AGE = Number(unit="s", above=0.0)


class MocapNode(Node):
    """Tell topics and tf where the rigid bodies of a motion capture system are."""

    def __init__(self):
        super().__init__()
        self._bodies = None
        self._backend = None
        self._settings = None
        self._up_axis = None
        self._stale_after = None
        self._tracker = None
        self._health = None
        self._receiver = None
        self._poses = {}
        self._poses2d = {}
        self._broadcast = None
        self._diagnostics = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        rigid_bodies = RigidBodies()
        self._bodies = handle.param("rigid_bodies", rigid_bodies)
        for name in rigid_bodies.unknown:
            handle.warn(f"parameter {handle.resolve('~rigid_bodies')}/{name} means nothing here")
        self._backend = handle.param("backend", Text((_NATNET, *SYSTEMS)), _NATNET)
        self._up_axis = handle.param("up_axis", Text(UP_AXES), "z")
        self._stale_after = handle.param("stale_after", _AGE, 0.2)
        if self._backend == _NATNET:
            self._settings = _natnet_settings(handle)
        else:
            self._settings = handle.param("motioncapture_config/hostname", TEXT)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._health = Health(self._bodies, self._stale_after, handle.time())
        self._tracker = Tracker(self._bodies, self._up_axis, self._stale_after, self._health)
        for body in self._bodies:
            if body.pose is not None:
                self._poses[body.key] = handle.publisher(_private(body.pose), PoseStamped)
            if body.pose2d is not None:
                self._poses2d[body.key] = handle.publisher(_private(body.pose2d), Pose2D)
        if any(body.child_frame_id for body in self._bodies):
            self._broadcast = handle.broadcast_transforms()
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        handle.timer(_REPORT_PERIOD, self._report, steady=True)
        handle.info(f"looking for {self._backend}; axis {self._up_axis} of its stream points up")
        self._receiver = self.make_receiver(handle)
        self._receiver.start()

    def make_receiver(self, handle):
        """Return the thread that calls this node's ``on_...`` in their turn."""
        return Receiver(
            lambda: self._make_source(handle),
            on_connected=lambda text: handle.submit(self.on_connected, text),
            on_frame=lambda frame: handle.submit(self.on_frame, frame),
            on_trouble=lambda text: handle.submit(self.on_trouble, text),
        )

    def shutdown(self) -> None:
        """Disconnect."""
        self._receiver.stop()

    def on_connected(self, server: str) -> None:
        """Take note of a new connection."""
        self._handle.info(f"connected to {server}")
        self._health.connected(server)
        self._tracker.restart()

    def on_trouble(self, text: str) -> None:
        """Warn that there is no connection."""
        self._handle.warn(f"{text} (trying again)", throttle=_REPEAT)
        self._health.disconnected(text)

    def on_frame(self, frame) -> None:
        """Publish a frame."""
        sightings = self._tracker.take(frame)
        if not sightings:
            return
        stamp = self._handle.stamp(sightings[0].time)
        transforms = []
        for sighting in sightings:
            body = sighting.body
            header = Header(stamp=stamp, frame_id=body.parent_frame_id)
            if body.key in self._poses:
                self._poses[body.key].publish(_pose(header, sighting))
            if body.key in self._poses2d:
                x, y, _ = sighting.position
                self._poses2d[body.key].publish(Pose2D(x, y, heading(sighting.quaternion)))
            if body.child_frame_id is not None:
                transforms.append(_transform(header, sighting))
        if transforms:
            self._broadcast(transforms)

    def _make_source(self, handle):
        if self._backend != _NATNET:
            return LibrarySource(self._backend, self._settings, handle.time)
        return NatNetSource(
            self._settings,
            handle.time,
            lambda text: handle.submit(handle.warn, text, _REPEAT, "datagram"),
        )

    def _report(self):
        statuses = self._health.report(self._handle.time())
        name = self._handle.name.lstrip("/")
        message = DiagnosticArray(header=Header(stamp=self._handle.stamp()))
        for status in statuses:
            values = [KeyValue(key, value) for key, value in status.values.items()]
            message.status.append(
                DiagnosticStatus(
                    level=status.level,
                    name=f"{name}: {status.component}",
                    message=status.message,
                    hardware_id=self._backend,
                    values=values,
                )
            )
        self._diagnostics.publish(message)
        stream, *bodies = statuses
        # Without a stream no body is seen; that is said already.
        faulty = bodies if stream.level < ERROR else []
        for status in faulty:
            if status.level == ERROR:
                text = f"{status.component}: {status.message}"
                self._handle.warn(text, throttle=_REPEAT, key=status.component)


def _natnet_settings(handle):
    def param(name, kind, default=None):
        return handle.param(f"optitrack_config/{name}", kind, default)

    return NatNetSettings(
        server_address=param("server_address", TEXT),
        local_address=param("local_address", Address()),
        multicast_address=param("multicast_address", Address(multicast=True)),
        command_port=param("command_port", _PORT, NatNetSettings.command_port),
        data_port=param("data_port", _PORT, NatNetSettings.data_port),
        version=param("version", StreamVersion()),
    )


def _private(topic):
    # As with the node of this name in C++: a relative name is the node's own.
    return topic if topic.startswith(("/", "~")) else "~" + topic


def _pose(header, sighting):
    pose = Pose(Point(*sighting.position), Quaternion(*sighting.quaternion))
    return PoseStamped(header, pose)


def _transform(header, sighting):
    transform = TransformStamped(header=header, child_frame_id=sighting.body.child_frame_id)
    transform.transform.translation = Vector3(*sighting.position)
    transform.transform.rotation = Quaternion(*sighting.quaternion)
    return transform
