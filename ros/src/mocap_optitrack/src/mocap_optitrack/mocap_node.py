"""ROS interface of a motion capture system."""

import math
from collections.abc import Callable
from functools import partial

import genpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import (
    Point,
    PointStamped,
    Pose,
    Pose2D,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from std_msgs.msg import Float32, Header
from std_srvs.srv import Trigger, TriggerResponse
from typing_extensions import override

from crazyflie_model.angles import quaternion_from_zyx, zyx_from_quaternion
from crazyflie_utils import Node, NodeHandle
from mocap_optitrack.bodies import RigidBody
from mocap_optitrack.frames import Frame
from mocap_optitrack.health import ERROR, Health
from mocap_optitrack.library_source import LibrarySource
from mocap_optitrack.mocap_parameters import NATNET, MocapParameters
from mocap_optitrack.natnet_source import NatNetSource
from mocap_optitrack.source import Receiver
from mocap_optitrack.tracker import BodyPose, Tracker

_REPORT_PERIOD = 1.0  #: Period of the diagnostics (s): REP 107 wants one report a second.
_REPEAT = 5.0  #: Shortest period of the same warning (s).

#: Age up to which a heading is used (s): a gyroscope drifts by some degrees a minute, and the
#: driver's headings come every 0.1 s.
MAX_HEADING_AGE = 2.0


class MocapNode(Node[MocapParameters]):
    """Publish the poses of a motion capture system's rigid bodies on topics and on tf."""

    needed_in_flight = True
    pose_type: type = PoseStamped  #: Message type of the topics with poses.

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        for name in parameters.unknown:
            handle.warn(f"parameter {handle.name}/{name} is unknown and has no effect")
        bodies, markers = parameters.bodies, parameters.markers
        self._server = ""
        self._stamp = genpy.Time()
        limits = (parameters.stale_after, handle.time(), parameters.rate_limits)
        self._health = Health(bodies, *limits)
        self._tracker = Tracker(
            bodies, parameters.up_axis, self._health, parameters.hold_time, handle.warn
        )
        self._poses = _publishers(handle, bodies, "pose", self.pose_type)
        self._poses2d = _publishers(handle, bodies, "pose2d", Pose2D)
        self._positions = _publishers(handle, markers, "position", PointStamped)
        self._headings: dict[str, tuple[float, float]] = {}
        for marker in markers:
            if marker.heading is not None:
                on_heading = partial(self._on_heading, marker.key)
                handle.subscribe(_private(marker.heading), Float32, on_heading)
        if markers:
            handle.advertise_service("~reset_lost", Trigger, self._reset_lost)
        self._broadcast: Callable[[list[TransformStamped]], None] | None = None
        if any(body.child_frame_id for body in bodies):
            self._broadcast = handle.broadcast_transforms()
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._request_landing = handle.advertise_landing_request()
        handle.timer(_REPORT_PERIOD, self._report, steady=True)
        handle.info(
            f"connecting to {parameters.backend}; axis {parameters.up_axis} of its stream points up"
        )
        self._on_complaint = handle.input(lambda text: handle.warn(text, _REPEAT, "datagram"))
        self._receiver = self.make_receiver(handle)
        handle.start(self._receiver.start)

    def add_body(self, body: RigidBody) -> None:
        """Publish a body from now on that is not in the parameters."""
        self._tracker.add(body)
        self._health.add(body)
        self._poses |= _publishers(self._handle, [body], "pose", self.pose_type)
        if self._broadcast is None and body.child_frame_id:
            self._broadcast = self._handle.broadcast_transforms()

    @override
    def _reconfigure(self, parameters: MocapParameters) -> None:
        self._health.stale_after = parameters.stale_after

    def make_receiver(self, handle: NodeHandle) -> Receiver:
        """Return the thread whose frames and events the executor passes to ``on_...``."""
        return Receiver(
            lambda: self._make_source(handle),
            on_connected=handle.input(self.on_connected),
            on_frame=handle.input(self.on_frame, Frame.of),
            on_silence=handle.input(self.on_silence),
            on_failure=handle.input(self.on_failure),
        )

    @override
    def prepare_shutdown(self) -> None:
        self._request_landing()

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
        """Warn that a connection is silent."""
        self._handle.warn(text, throttle=_REPEAT, key="silence")
        self._health.silent(text)

    def on_failure(self, text: str) -> None:
        """Warn that there is no connection."""
        self._handle.warn(f"{text} (retrying)", throttle=_REPEAT)
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
            header = Header(stamp=stamp, frame_id=body.parent_frame_id)
            if body.key in self._positions:
                point = PointStamped(header, Point(*pose.position))
                self._positions[body.key].publish(point)
            quaternion = pose.quaternion or self._heading_quaternion(body)
            if quaternion is None:
                continue
            oriented = pose._replace(quaternion=quaternion)
            if body.key in self._poses:
                self._poses[body.key].publish(self.pose_message(header, oriented))
            if body.key in self._poses2d:
                x, y, _ = pose.position
                yaw = zyx_from_quaternion(quaternion)[2]
                self._poses2d[body.key].publish(Pose2D(x, y, yaw))
            if body.child_frame_id is not None:
                transforms.append(transform_of(header, oriented))
        if transforms and self._broadcast is not None:
            self._broadcast(transforms)

    @staticmethod
    def pose_message(header: Header, pose: BodyPose) -> genpy.Message:
        """Return a message of `pose_type`."""
        assert pose.quaternion is not None
        return PoseStamped(header, Pose(Point(*pose.position), Quaternion(*pose.quaternion)))

    def _on_heading(self, key, message):
        if math.isfinite(message.data):
            self._headings[key] = (self._handle.time(), message.data)

    def _heading_quaternion(self, body):
        """Return the attitude of a vehicle with one marker, taken as level; None if unknown."""
        if body.heading is None:
            return None
        now = self._handle.time()
        time, yaw = self._headings.get(body.key, (-math.inf, 0.0))
        if now - time > MAX_HEADING_AGE:
            self._handle.warn(
                f"{body.key}: no heading on {body.heading} for {MAX_HEADING_AGE:g} s: "
                "its pose is not published; is the driver connected to it?",
                throttle=_REPEAT,
                key=f"heading {body.key}",
            )
            return None
        return quaternion_from_zyx(0.0, 0.0, yaw)

    def _reset_lost(self, _):
        names = ", ".join(self._tracker.reset_lost())
        text = f"expected at their start points: {names}" if names else "no vehicle is lost"
        self._handle.info(text)
        return TriggerResponse(True, text)

    def _make_source(self, handle):
        parameters = self._parameters
        if parameters.backend != NATNET:
            hostname = parameters.hostname
            assert hostname is not None, "MocapParameters.complaints sees to it"
            needs_points = bool(parameters.markers)
            return LibrarySource(parameters.backend, hostname, handle.time, needs_points)
        return NatNetSource(
            parameters.natnet,
            handle.time,
            self._on_complaint,
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
            # Without a stream no body is seen, for which a warning was logged.
            if status.level == ERROR and stream.level < ERROR:
                text = f"{status.component}: {status.message}"
                self._handle.warn(text, throttle=_REPEAT, key=status.component)


def _publishers(handle, bodies, output, message_type):
    """Return body's key -> publisher of an output, for the bodies that have it."""
    topics = {body.key: getattr(body, output) for body in bodies}
    return {
        key: handle.publisher(_private(topic), message_type)
        for key, topic in topics.items()
        if topic is not None
    }


def _private(topic):
    # A relative name is below the node's, as with the C++ node of this name.
    return topic if topic.startswith(("/", "~")) else "~" + topic


def transform_of(header: Header, pose: BodyPose) -> TransformStamped:
    """Return the frame of a body, whose attitude is known."""
    assert pose.quaternion is not None
    transform = Transform(Vector3(*pose.position), Quaternion(*pose.quaternion))
    return TransformStamped(header, pose.body.child_frame_id, transform)
