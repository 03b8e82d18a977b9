"""ROS interface of a motion capture system."""

from functools import partial

import genpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    Pose,
    Pose2D,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle
from mocap_optitrack.axes import heading
from mocap_optitrack.frames import Frame
from mocap_optitrack.health import ERROR, Health
from mocap_optitrack.library_source import LibrarySource
from mocap_optitrack.natnet_source import NatNetSource
from mocap_optitrack.parameters import NATNET, MocapParameters
from mocap_optitrack.source import Receiver
from mocap_optitrack.tracker import Tracker

_REPORT_PERIOD = 1.0
"""Of the diagnostics, s; REP 107 wants one report a second."""

_REPEAT = 5.0
"""The same warning comes at most this often, s."""


class MocapNode(Node):
    """Publish where the rigid bodies of a motion capture system are, as topics and on tf."""

    needed_in_flight = True

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(MocapParameters, self._reconfigure)
        for name in self._parameters.rigid_bodies.unknown:
            handle.warn(f"parameter {handle.resolve('~rigid_bodies')}/{name} means nothing here")

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        bodies, stale_after = parameters.rigid_bodies.bodies, parameters.stale_after
        self._server = ""
        self._stamp = genpy.Time()
        self._health = Health(bodies, stale_after, handle.time())
        self._tracker = Tracker(bodies, parameters.up_axis, stale_after, self._health)
        self._poses = {
            body.key: handle.publisher(_private(body.parameters.pose), PoseStamped)
            for body in bodies
            if body.parameters.pose is not None
        }
        self._poses2d = {
            body.key: handle.publisher(_private(body.parameters.pose2d), Pose2D)
            for body in bodies
            if body.parameters.pose2d is not None
        }
        if any(body.parameters.child_frame_id for body in bodies):
            self._broadcast = handle.broadcast_transforms()
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        handle.timer(_REPORT_PERIOD, self._report, steady=True)
        handle.info(
            f"looking for {parameters.backend}; axis {parameters.up_axis} of its stream points up"
        )
        self._receiver = self.make_receiver(handle)
        self._receiver.start()

    def _reconfigure(self, parameters):
        self._health.stale_after = parameters.stale_after
        self._tracker.stale_after = parameters.stale_after

    def make_receiver(self, handle: NodeHandle) -> Receiver:
        """Return the thread whose frames and events the executor passes to ``on_...``."""
        return Receiver(
            lambda: self._make_source(handle),
            on_connected=partial(handle.submit, self.on_connected),
            on_frame=partial(handle.submit, self.on_frame),
            on_silence=partial(handle.submit, self.on_silence),
            on_failure=partial(handle.submit, self.on_failure),
        )

    @override
    def shutdown(self) -> None:
        self._receiver.stop()

    def on_connected(self, server: str) -> None:
        """Log a new connection; another server has another clock."""
        self._handle.info(f"connected to {server}")
        self._health.connected(server)
        if server != self._server:
            self._server = server
            self._tracker.restart()

    def on_silence(self, text: str) -> None:
        """Warn that nothing comes over a connection."""
        self._handle.warn(text, throttle=_REPEAT, key="silence")
        self._health.silent(text)

    def on_failure(self, text: str) -> None:
        """Warn that there is no connection."""
        self._handle.warn(f"{text} (trying again)", throttle=_REPEAT)
        self._health.disconnected(text)

    def on_frame(self, frame: Frame) -> None:
        """Publish a frame."""
        poses = self._tracker.process(frame)
        if not poses:
            return
        stamp = self._handle.stamp(poses[0].time)
        if stamp < self._stamp:
            step = (self._stamp - stamp).to_sec()
            text = f"this machine's clock was set back by {step:.3f} s: stamps step back too"
            self._handle.warn(text, throttle=_REPEAT, key="clock")
        self._stamp = stamp
        transforms = []
        for pose in poses:
            body = pose.body
            header = Header(stamp=stamp, frame_id=body.parameters.parent_frame_id)
            if body.key in self._poses:
                self._poses[body.key].publish(_pose(header, pose))
            if body.key in self._poses2d:
                x, y, _ = pose.position
                self._poses2d[body.key].publish(Pose2D(x, y, heading(pose.quaternion)))
            if body.parameters.child_frame_id is not None:
                transforms.append(_transform(header, pose))
        if transforms:
            self._broadcast(transforms)

    def _make_source(self, handle):
        parameters = self._parameters
        if parameters.backend != NATNET:
            hostname = parameters.library.hostname
            assert hostname is not None, "MocapParameters.complaints sees to it"
            return LibrarySource(parameters.backend, hostname, handle.time)
        return NatNetSource(
            parameters.natnet,
            handle.time,
            lambda text: handle.submit(handle.warn, text, _REPEAT, "datagram"),
        )

    def _report(self):
        statuses = self._health.report(self._handle.time())
        name = self._handle.name.lstrip("/")
        reports = [
            DiagnosticStatus(
                level=status.level,
                name=f"{name}: {status.component}",
                message=status.message,
                hardware_id=self._parameters.backend,
                values=[KeyValue(key, value) for key, value in status.values.items()],
            )
            for status in statuses
        ]
        self._diagnostics.publish(DiagnosticArray(Header(stamp=self._handle.stamp()), reports))
        stream, *bodies = statuses
        for status in bodies:
            # Without a stream no body is seen; that has been warned of.
            if status.level == ERROR and stream.level < ERROR:
                text = f"{status.component}: {status.message}"
                self._handle.warn(text, throttle=_REPEAT, key=status.component)


def _private(topic):
    # As with the node of this name in C++: a relative name is the node's own.
    return topic if topic.startswith(("/", "~")) else "~" + topic


def _pose(header, pose):
    return PoseStamped(header, Pose(Point(*pose.position), Quaternion(*pose.quaternion)))


def _transform(header, pose):
    transform = Transform(Vector3(*pose.position), Quaternion(*pose.quaternion))
    return TransformStamped(header, pose.body.parameters.child_frame_id, transform)
