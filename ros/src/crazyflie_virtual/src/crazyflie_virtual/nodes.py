"""Virtual vehicle and virtual motion capture as ROS nodes: parameters are settings and switches."""

from functools import partial
from typing import ClassVar, cast

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from typing_extensions import override

from crazyflie_model.aerodynamics import Air
from crazyflie_utils import Node, NodeHandle, ParameterError, TransformError, topic
from crazyflie_virtual.mocap import MocapServer, MocapSettings
from crazyflie_virtual.server import Server, VehicleServer
from crazyflie_virtual.settings import VehicleSettings

_POLL_PERIOD = 0.5  #: Period at which the switches are read (s).


class ServerNode(Node):
    """Runs a server; switches are polled, so that ``rosparam set`` also works on them."""

    sources = "sockets"

    needed_in_flight = True

    #: ``server_type(parameters, warn)`` listens, or raises `OSError`; ``warn(text)`` logs.
    server_type: ClassVar[type]

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        try:
            self._server: Server = self.server_type(
                self._parameters, lambda text: handle.warn(text, throttle=1.0)
            )
        except OSError as error:
            raise ParameterError(
                f"{handle.name} cannot listen: {error}; is another one running? If not, "
                "choose another port"
            ) from None
        self._server.start()
        handle.info(self._server.description)
        handle.timer(_POLL_PERIOD, self._poll, steady=True)

    @override
    def shutdown(self) -> None:
        self._server.stop()

    def _reconfigure(self, _):
        # After this callback the change is on the parameter server, where _poll compares it with
        # the last values: one rule for both ways of changing a switch.
        self._handle.submit(self._poll)

    def _poll(self):
        try:
            parameters = self._handle.load(self.parameters_type)
        except ParameterError as error:
            self._handle.warn(str(error), throttle=5.0)
            return
        # Only changed values, since clients may also have set switches.
        for name in vars(self._server.switches):
            value = getattr(parameters, name)
            if value != getattr(self._parameters, name):
                setattr(self._server.switches, name, value)
        self._parameters = parameters


_POSE_PERIOD = 0.05  #: Period at which the true pose is published (s).
_LOOK_PERIOD = 0.05  #: Period at which the moving objects of the vehicle's world are looked up, s.


class VehicleParameters(VehicleSettings):
    """Parameters of `VirtualCrazyflieNode`."""

    true_pose_topic: str = topic(
        "true_pose", "the true pose, for the drift in a report", "~true_pose"
    )


class VirtualCrazyflieNode(ServerNode):
    """A virtual vehicle behind a UDP port.

    Moving objects of its world have the pose on /tf, or their initial one.
    """

    parameters_type = VehicleParameters
    server_type = VehicleServer

    air: Air | None = None  #: Air that this vehicle and others of the process move; None for none.

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        super().register_callbacks(handle)
        physics = cast(VehicleServer, self._server).vehicle.physics
        physics.air = self.air
        self._true_pose = handle.publisher(self._parameters.true_pose_topic, PoseStamped)
        handle.timer(_POSE_PERIOD, partial(self._publish, physics))
        if physics.world is not None and physics.world.moving:
            self._lookup = handle.listen_to_transforms()
            handle.timer(_LOOK_PERIOD, partial(self._look, physics, physics.world))

    def _publish(self, physics):
        if self._true_pose.has_subscribers():
            position, orientation = Point(*physics.position), Quaternion(*physics.quaternion)
            message = PoseStamped(pose=Pose(position, orientation))
            message.header.stamp, message.header.frame_id = self._handle.stamp(), "world"
            self._true_pose.publish(message)

    def _look(self, physics, world):
        centres = {}
        for each in world.moving:
            try:
                place = self._lookup(world.frame, each.name).transform.translation
            except TransformError:
                # No node moves the object at present: it keeps its place.
                continue
            centres[each.name] = (place.x, place.y, place.z)
        physics.world = world.placed(centres)


class VirtualMocapNode(ServerNode):
    """A NatNet server."""

    parameters_type = MocapSettings
    server_type = MocapServer
