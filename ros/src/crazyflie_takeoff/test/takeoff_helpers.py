"""A vehicle and a controller for the tests, and processes that can be killed."""

from bisect import bisect_right
from collections import defaultdict

from std_srvs.srv import EmptyRequest

from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FilterStatus,
    FlightStatus,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff.phases import FlightState
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode, status_text
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.node import Node
from crazyflie_utils.testing.fake_graph import FakeGraph

GRAVITY = 9.81

SERVER = {
    "topics/reference": "/ref",
    "topics/control": "/control/takeoff",
    "topics/in_flight": "/in_flight",
    "topics/state": "/state",
    "hover/x": 0.0,
    "hover/y": 0.0,
    "hover/z": 1.0,
}

FILTER = {
    "topics/takeoff_control": "/control/takeoff",
    "topics/commanded_control": "/control/lqr",
    "topics/final_control": "/control/final",
    "topics/in_flight": "/in_flight",
}

BARE = {key: value for key, value in SERVER.items() if key != "topics/state"}
"""Parameters of a server that does not know the height."""


def control(thrust):
    """Return a control message with level attitude."""
    return ControlStamped(control=Control(thrust=thrust))


def state(z, z_dot=0.0, stamp=None):
    """Return a state message above the origin; without a stamp (ROS time) by default."""
    message = PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=z, z_dot=z_dot))
    if stamp is not None:
        message.header.stamp = stamp
    return message


def filter_status(remembered="unknown", state=FilterStatus.PASSING, **fields):
    """Return what a filter publishes that has heard a flight state last, and has a controller."""
    code = getattr(FlightStatus, remembered.upper())
    return FilterStatus(state=state, flight_state=code, **{"has_controller": True, **fields})


class PointMass:
    """A vehicle that moves up and down: z_ddot = thrust - g; the ground is at z = ``ground``.

    As the firmware does, it stops its motors 2 s after the last control.
    """

    STEP = 0.001

    def __init__(self, z=0.0):
        self.z, self.z_dot = z, 0.0
        self.ground = 0.0
        self.thrust, self.age = None, 0.0
        self.touchdown_speed = 0.0

    def command(self, thrust):
        """Take a thrust, m/s^2."""
        self.thrust, self.age = thrust, 0.0

    def advance(self, duration):
        """Move on in steps of constant acceleration, each exact."""
        for _ in range(round(duration / self.STEP)):
            self._step()

    def _step(self):
        if self.thrust is None:
            return
        self.age += self.STEP
        acceleration = (self.thrust if self.age < 2.0 else 0.0) - GRAVITY
        was_above = self.z > self.ground
        self.z += self.z_dot * self.STEP + 0.5 * acceleration * self.STEP**2
        self.z_dot += acceleration * self.STEP
        if self.z <= self.ground:
            if was_above:
                self.touchdown_speed = -self.z_dot
            self.z, self.z_dot = self.ground, max(self.z_dot, 0.0)


def feedback(reference, z, z_dot, gains=(20.0, 20.98)):
    """Return the thrust of linear feedback with the controller's limits, m/s^2.

    The default gains are those of the quadratic regulator of the double
    integrator for Q = diag(2, 2)^2, R = 0.1^2: sqrt(q/r), sqrt(q/r + 2 sqrt(q/r)).
    """
    z_ref, z_dot_ref = reference
    thrust = GRAVITY + gains[0] * (z_ref - z) + gains[1] * (z_dot_ref - z_dot)
    return min(16.0, max(4.0, thrust))


class VehicleNode(Node):
    """The point mass on topics: final control in, state out every 10 ms."""

    def __init__(self):
        super().__init__()
        self.vehicle = PointMass()
        self.sees = True
        self.offset = 0.0
        self._state = None

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._state = handle.publisher("/state", PositionVelocityYawStateStamped)
        handle.subscribe("/control/final", ControlStamped, self._on_control)
        handle.timer(0.01, self._on_timer)

    def _on_control(self, message):
        self.vehicle.command(message.control.thrust)

    def _on_timer(self):
        self.vehicle.advance(0.01)
        if self.sees:
            height = self.vehicle.z + self.offset
            self._state.publish(state(height, self.vehicle.z_dot, self._handle.stamp()))


class ControllerNode(Node):
    """Feedback on topics; silent until a reference has come."""

    def __init__(self):
        super().__init__()
        self._reference = None
        self._control = None

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._control = handle.publisher("/control/lqr", ControlStamped)
        handle.subscribe("/ref", PositionVelocityStateStamped, self._on_reference)
        handle.subscribe("/state", PositionVelocityYawStateStamped, self._on_state)

    def _on_reference(self, message):
        self._reference = (message.state.z, message.state.z_dot)

    def _on_state(self, message):
        if self._reference is not None:
            thrust = feedback(self._reference, message.state.z, message.state.z_dot)
            self._control.publish(control(thrust))


def text_of(message):
    """Return the text of a message, or the word of the state that it has."""
    if isinstance(message, FlightStatus):
        return FlightState(message.state).word
    return status_text(message) if isinstance(message, FilterStatus) else message.data


class Network(FakeGraph):
    """Processes that remember what they have said; their names are those of their nodes."""

    TICK = 0.01

    def __init__(self):
        super().__init__({})
        #: By topic: times, and what was said then by whom.
        self._times = defaultdict(list)
        self._said = defaultdict(list)

    def start(self, name, node, parameters=None):
        """Start a node in a process of its own; return the node."""
        for key, value in (parameters or {}).items():
            self._parameters[f"/{name}/{key}"] = value
        super().start(f"/{name}", node)
        return node

    def kill(self, name):
        """End a process without a word."""
        super().kill(f"/{name}")

    def call(self, service):
        """Call a service; return a future if it takes time."""
        answer = super().call(service, EmptyRequest())
        return answer.result() if answer.done() else answer

    def process(self, name):
        """Return a process."""
        return self._processes[f"/{name}"]

    def advance_until(self, condition, limit=30.0):
        """Advance the time until a condition holds."""
        end = self.time + limit
        while not condition():
            assert self.time < end, "the condition never came true"
            self.advance(self.TICK)

    def subscribes(self, topic, excluding):
        """Return that all topics are listened to, as by rosbag."""
        return True

    def publish(self, topic, message, caller=""):
        """Publish a message of a process, and remember it."""
        self._times[topic].append(self.time)
        self._said[topic].append((caller, message))
        super().publish(topic, message, caller)

    def on(self, topic, since=0.0):
        """Return what was said on a topic after a moment, as (time, message)."""
        times = self._times[topic]
        first = bisect_right(times, since)
        return [
            (time, m) for time, (_, m) in zip(times[first:], self._said[topic][first:], strict=True)
        ]

    def last(self, topic):
        """Return the last text or state on a topic."""
        return text_of(self._said[topic][-1][1])

    def last_of(self, name, topic):
        """Return the last message of a process on a topic."""
        return next(m for by, m in reversed(self._said[topic]) if by == f"/{name}")


class HoverNetwork(Network):
    """Vehicle, controller, filter and server.

    Parameters
    ----------
    server : dict
        Parameters of the server.
    filter_parameters : dict
        Those of the filter that are not `FILTER`'s.
    """

    def __init__(self, server=None, filter_parameters=None):
        super().__init__()
        self.server_parameters = server or SERVER
        self.filter_parameters = {**FILTER, "topics/state": "/state", **(filter_parameters or {})}
        self.vehicle_node = self.start("vehicle", VehicleNode())
        self.vehicle = self.vehicle_node.vehicle
        self.start("controller", ControllerNode())
        self.start_filter()
        self.start_server()

    def start_filter(self):
        """Start a filter."""
        self.start("filter", TakeoffControlFilterNode(), self.filter_parameters)

    def start_server(self):
        """Start a server."""
        self.server = self.start("server", TakeoffServerNode(), self.server_parameters)

    def take_off(self):
        """Take off and wait until the vehicle is flying."""
        self.advance(0.5)
        future = self.call("/takeoff")
        self.advance_until(future.done)
        assert future.exception() is None
