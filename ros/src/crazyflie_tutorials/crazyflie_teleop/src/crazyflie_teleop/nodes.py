"""The ROS interfaces: circle and joystick to cmd_vel, a call of takeoff, and the controller."""

import math
from collections.abc import Sequence

from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy
from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_lqr.lqr_nodes import PositionVelocityYawStateLiftLqrNode
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_references.velocity_reference import Velocity
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import BOOLEAN, SERVICE, TIME_STEP, Integer, Number


def circle_velocity(radius: float, speed: float, clockwise: bool) -> Velocity:
    """Return the velocity, in the heading frame, of a vehicle that looks along its circle.

    The yaw rate is speed (m/s) over radius (m), negative for a turn that is clockwise as seen from
    above.
    """
    yaw_dot = speed / radius
    return Velocity(x=speed, yaw_dot=-yaw_dot if clockwise else yaw_dot)


class CircleParameters(Parameters):
    """Parameters of `CircleNode`."""

    cmd_vel_topic: str = topic("cmd_vel", "topic of the velocities", "cmd_vel")
    time_step: float = parameter(TIME_STEP, "period of the velocities", 0.1)
    radius: float = parameter(Number("m", above=0.0), "radius of the circle", 0.5, live=True)
    speed: float = parameter(Number("m/s", above=0.0), "speed along the circle", 0.3, live=True)
    clockwise: bool = parameter(BOOLEAN, "direction, as seen from above", True, live=True)


class CircleNode(Node):
    """Publish the velocity of a circle repeatedly."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._reconfigure(handle.load(CircleParameters, self._reconfigure))

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self._parameters.cmd_vel_topic, Twist)
        handle.timer(self._parameters.time_step, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._publisher.publish(Twist())

    def _reconfigure(self, parameters):
        self._parameters = parameters
        velocity = circle_velocity(parameters.radius, parameters.speed, parameters.clockwise)
        self._twist = Twist(linear=Vector3(x=velocity.x), angular=Vector3(z=velocity.yaw_dot))

    def _on_timer(self):
        self._publisher.publish(self._twist)


FLIGHT_LIMIT = 120.0  #: Timeout of takeoff and landing (s of the machine's clock).


AXIS_NUMBER = Integer(0, 63)  #: Number of an axis or a button of sensor_msgs/Joy.


class AxisParameters(Parameters):
    """Numbers of axes, from 0, as on gamepads and crazyflie_demo's keyboard."""

    forward: int = parameter(AXIS_NUMBER, "flies ahead", 4)
    left: int = parameter(AXIS_NUMBER, "axis of the velocity to the left", 3)
    up: int = parameter(AXIS_NUMBER, "rises", 1)
    turn: int = parameter(AXIS_NUMBER, "axis of the yaw rate to the left", 0)


class JoyVelocityParameters(Parameters):
    """Parameters of `JoyVelocityNode`."""

    axes: AxisParameters = group(AxisParameters, "axes")
    horizontal: float = parameter(
        Number("m/s", above=0.0), "speed at full deflection", 0.5, "speed/horizontal", live=True
    )
    vertical: float = parameter(
        Number("m/s", above=0.0), "speed at full deflection", 0.3, "speed/vertical", live=True
    )
    yaw_dot: float = parameter(
        Number("rad/s", above=0.0), "yaw rate at full deflection", 1.0, "speed/yaw_dot", live=True
    )
    joy_topic: str = topic("joy", "a joystick, or a keyboard", "joy")
    cmd_vel_topic: str = topic("cmd_vel", "topic of the velocities", "cmd_vel")
    takeoff_service: str = parameter(SERVICE, "takes off", "/takeoff", "srv/takeoff")
    land_service: str = parameter(SERVICE, "lands", "/land", "srv/land")
    emergency_service: str | None = parameter(
        SERVICE,
        "stops the motors, such as the driver's; without it the vehicle lands",
        None,
        "srv/emergency",
    )
    takeoff_button: int = parameter(AXIS_NUMBER, "calls takeoff", 2, "buttons/takeoff")
    land_button: int = parameter(AXIS_NUMBER, "calls land", 0, "buttons/land")
    emergency_button: int = parameter(AXIS_NUMBER, "calls emergency", 1, "buttons/emergency")

    def velocity(self, deflections: Sequence[float]) -> Velocity:
        """Return the velocity for deflections from -1 to 1; an axis that is missing is at 0."""

        def deflection(axis):
            value = deflections[axis] if axis < len(deflections) else 0.0
            return min(max(value, -1.0), 1.0)

        return Velocity(
            self.horizontal * deflection(self.axes.forward),
            self.horizontal * deflection(self.axes.left),
            self.vertical * deflection(self.axes.up),
            self.yaw_dot * deflection(self.axes.turn),
        )


class JoyVelocityNode(Node[JoyVelocityParameters]):
    """Publish a velocity for every message of a joystick; without messages, publish nothing."""

    def __init__(self) -> None:
        self._pressed: set[int] = set()

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self._parameters.cmd_vel_topic, Twist)
        handle.subscribe(self._parameters.joy_topic, Joy, self._on_joy)

    @override
    def enter_safe_state(self) -> None:
        """Stop the vehicle."""
        self._publisher.publish(Twist())

    def _on_joy(self, message):
        if not all(map(math.isfinite, message.axes)):
            self._handle.warn("ignoring a joystick's axes that are not finite", throttle=1.0)
            return
        v = self._parameters.velocity(message.axes)
        self._publisher.publish(Twist(linear=Vector3(v.x, v.y, v.z), angular=Vector3(z=v.yaw_dot)))
        pressed = {number for number, is_down in enumerate(message.buttons) if is_down}
        new, self._pressed = pressed - self._pressed, pressed
        parameters = self._parameters
        if parameters.emergency_button in new:
            self._call(parameters.emergency_service or parameters.land_service)
        elif parameters.land_button in new:
            self._call(parameters.land_service)
        elif parameters.takeoff_button in new:
            self._call(parameters.takeoff_service)

    def _call(self, service):
        def on_reply(reply):
            if reply.exception() is not None:
                self._handle.warn(str(reply.exception()))

        future = self._handle.call_service(service, Empty, EmptyRequest(), FLIGHT_LIMIT)
        future.add_done_callback(on_reply)


PERIOD = 0.5  #: Period of the checks whether the service is offered (s of the machine's clock).


class TakeoffCallerParameters(Parameters):
    """Parameters of `TakeoffCallerNode`."""

    service: str = parameter(
        SERVICE, "service that is called once, when it is offered", "/takeoff", "srv/takeoff"
    )


class TakeoffCallerNode(Node[TakeoffCallerParameters]):
    """Call takeoff once, as soon as the service is offered."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._service = handle.resolve(self._parameters.service)
        self._timer = handle.timer(PERIOD, self._on_timer, steady=True)

    def _on_timer(self):
        if self._service not in self._handle.service_nodes():
            return
        self._timer.stop()
        future = self._handle.call_service(self._service, Empty, EmptyRequest(), FLIGHT_LIMIT)
        future.add_done_callback(self._on_reply)

    def _on_reply(self, reply):
        if reply.exception() is None:
            self._handle.info("the vehicle is flying")
        else:
            self._handle.error(str(reply.exception()))


class HeadingLiftLqrNode(PositionVelocityYawStateLiftLqrNode):
    """Saturated linear feedback with an integrator, to a position, velocity and yaw.

    Without an integrator a real vehicle, which is heavier than the nominal one, flies far too low.
    """

    reference_type = PositionVelocityYawStateStamped
    reference_tail = ()
