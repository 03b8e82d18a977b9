"""A vehicle and a controller for the tests, and processes that can be killed."""

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
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.node import Node
from crazyflie_utils.testing import FakeProcess

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
    """Return what a filter publishes that has heard a flight state last."""
    code = getattr(FlightStatus, remembered.upper())
    return FilterStatus(state=state, flight_state=code, **fields)


class PointMass:
    """A vehicle that moves up and down: z_ddot = thrust - g, the ground is z = 0.

    As the firmware does, it stops its motors 2 s after the last control.
    """

    STEP = 0.001

    def __init__(self, z=0.0):
        self.z, self.z_dot = z, 0.0
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
        was_above = self.z > 0.0
        self.z += self.z_dot * self.STEP + 0.5 * acceleration * self.STEP**2
        self.z_dot += acceleration * self.STEP
        if self.z <= 0.0:
            if was_above:
                self.touchdown_speed = -self.z_dot
            self.z, self.z_dot = 0.0, max(self.z_dot, 0.0)


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


class Network:
    """Nodes in fake processes of their own, connected as on a ROS master.

    They share the parameter server. Messages on the topics in ``unheard``, (name, topic), do not
    reach the process of this name.

    All live by one clock. A process can be killed at any moment, and another
    one be started in its place, which is told what is latched by those alive.
    """

    LATCHED = ("/ref", "/in_flight_state", "/in_flight_flight_status", "/in_flight_filter_status")
    TICK = 0.01

    def __init__(self):
        self.time = 100.0
        self.heard = []
        self.unpublished = set()
        self.unheard = set()
        self.parameters = {}
        self._processes = {}
        self._sent = {}

    def start(self, name, node, parameters=None):
        """Start a node in a process of its own; return the node."""
        process = FakeProcess(start=self.time)
        process.transport.unpublished |= self.unpublished
        process.transport.parameters = self.parameters
        assert process.launch(node, f"/{name}", parameters), process.logged("error")
        for other in self._processes.values():
            for topic in self.LATCHED:
                outlet = other.transport.publishers.get(topic)
                if outlet and outlet.messages and topic in process.transport.subscribers:
                    process.publish(topic, outlet.messages[-1])
        self._processes[name] = process
        self._sent[name] = {}
        self._exchange()
        return node

    def kill(self, name):
        """End a process without a word."""
        del self._processes[name]

    def call(self, service):
        """Call a service of the server."""
        return self._processes["server"].call(service, EmptyRequest())

    def process(self, name):
        """Return a process."""
        return self._processes[name]

    def advance(self, duration):
        """Let time pass, s."""
        for _ in range(round(duration / self.TICK)):
            self.time += self.TICK
            for process in list(self._processes.values()):
                process.advance(self.time - process.clock.time())
                self._exchange()

    def advance_until(self, condition, limit=30.0):
        """Let time pass until a condition holds."""
        end = self.time + limit
        while not condition():
            assert self.time < end, "the condition never came true"
            self.advance(self.TICK)

    def on(self, topic, since=0.0):
        """Return what was said on a topic after a moment, as (time, message)."""
        return [(time, m) for time, name, m in self.heard if name == topic and time > since]

    def last(self, topic):
        """Return the last text on a topic."""
        return self.on(topic)[-1][1].data

    def _exchange(self):
        moved = True
        while moved:
            moved = False
            for name, process in list(self._processes.items()):
                for topic, outlet in process.transport.publishers.items():
                    first = self._sent[name].get(topic, 0)
                    self._sent[name][topic] = len(outlet.messages)
                    for message in outlet.messages[first:]:
                        moved = True
                        self.heard.append((self.time, topic, message))
                        self._deliver(process, topic, message)

    def _deliver(self, sender, topic, message):
        names = {id(process): name for name, process in self._processes.items()}
        message._connection_header = {"callerid": f"/{names[id(sender)]}", "topic": topic}
        for name, other in self._processes.items():
            if other is not sender and topic in other.transport.subscribers:
                if (name, topic) not in self.unheard:
                    other.publish(topic, message)


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
