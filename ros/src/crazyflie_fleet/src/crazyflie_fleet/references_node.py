"""ROS interface of what leads vehicles along ways, and apart."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToResponse
from crazyflie_fleet.fleet import Vehicle
from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_fleet.stack import FLIGHT_STATE, REFERENCE, SAFE_REFERENCE, STATE
from crazyflie_fleet.way import Way
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter
from crazyflie_utils.parameter_types import TIME_STEP, TOPIC
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.runtime.topics import Publisher
from crazyflie_utils.vectors import is_finite

STATE_LIMIT = 0.5
"""A vehicle whose state is older than this is not led anywhere, s."""

FLYING = "flying"
_WATCHED = ("taking_off", FLYING, "descending")


class ReferencesParameters(Parameters):
    """Parameters of `ReferencesNode`."""

    way_period: float = parameter(TIME_STEP, "from one reference of a way to the next", 0.02)
    watch_period: float = parameter(TIME_STEP, "from one look at the distances to the next", 0.05)
    waiting_topic: str = parameter(TOPIC, "who waits for whom", "/fleet/waiting", "topics/waiting")


@dataclass
class _Led:
    """A vehicle that is led or, without a publisher, only seen; times are in s."""

    vehicle: Vehicle
    publisher: Publisher | None = None
    state: PositionVelocityYawStateStamped | None = None
    state_time: float = 0.0
    flight_state: str = ""
    wanted: PositionVelocityStateStamped | None = None
    way: Way | None = None
    way_time: float = 0.0
    waits: bool = False


class ReferencesNode(Node):
    """Pass on the references of vehicles, unless they lead one too near to another.

    Parameters
    ----------
    vehicles : sequence of Vehicle
        Those that are flown in this process.
    others : sequence of Vehicle
        Those that are flown elsewhere, from which the former keep apart.
    fixed_frame : str
    """

    needed_in_flight = True

    def __init__(
        self, vehicles: tuple[Vehicle, ...], others: tuple[Vehicle, ...], fixed_frame: str
    ):
        self._vehicles = vehicles
        self._others = others
        self._fixed_frame = fixed_frame
        self._separation = Separation([vehicle.buffer for vehicle in (*vehicles, *others)])
        # Own ones first.
        self._seen: list[_Led] = []
        self._told = ""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(ReferencesParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._waiting = handle.publisher(parameters.waiting_topic, String, latch=True)
        self._publish_mocap_frames(handle)
        for vehicle in self._vehicles:
            self._lead(handle, vehicle)
        for vehicle in self._others:
            self._see(handle, _Led(vehicle))
        handle.timer(parameters.way_period, self._on_way_timer)
        handle.timer(parameters.watch_period, self._on_watch_timer)

    def _lead(self, handle, vehicle):
        below = f"/{vehicle.name}/"
        led = _Led(vehicle, handle.publisher(below + SAFE_REFERENCE, PositionVelocityStateStamped))
        handle.advertise_service(below + "go_to", GoTo, partial(self._on_go_to, led))
        handle.subscribe(
            below + REFERENCE, PositionVelocityStateStamped, partial(self._on_reference, led)
        )
        self._see(handle, led)

    def _see(self, handle, led):
        below = f"/{led.vehicle.name}/"
        on_state = partial(self._on_state, led)
        handle.subscribe(below + STATE, PositionVelocityYawStateStamped, on_state)
        handle.subscribe(below + FLIGHT_STATE, String, partial(self._on_flight_state, led))
        self._seen.append(led)

    def _publish_mocap_frames(self, handle):
        # What motion capture calls a vehicle is the vehicle.
        identity = Transform(Vector3(), Quaternion(w=1.0))
        transforms = [
            TransformStamped(Header(0, handle.stamp(), vehicle.mocap_frame), vehicle.name, identity)
            for vehicle in self._vehicles
            if vehicle.mocap_frame != vehicle.name
        ]
        if transforms:
            static = handle.publisher("/tf_static", TFMessage, latch=True)
            static.publish(TFMessage(transforms))

    # What it hears.

    def _on_state(self, led, message):
        led.state = message
        led.state_time = self._handle.time()

    def _on_flight_state(self, led, message):
        led.flight_state = message.data
        if message.data != FLYING:
            led.way = None

    def _on_reference(self, led, message):
        if not is_finite(message.state):
            # What is to be done about it is the controller's business.
            led.publisher.publish(message)
            return
        led.way = None
        self._want(led, message)

    def _want(self, led, message):
        led.wanted = message
        if not led.waits:
            led.publisher.publish(message)

    # Ways.

    def _on_go_to(self, led, request):
        goal = (request.goal.x, request.goal.y, request.goal.z)
        duration = request.duration.to_sec()
        name = f"/{led.vehicle.name}/go_to refused"
        if led.flight_state != FLYING or not self._knows(led):
            raise ServiceError(f"{name}: the vehicle is not in flight")
        if not np.isfinite(goal).all():
            raise ServiceError(f"{name}: the goal is {goal}; expected finite numbers (m)")
        if request.yaw != 0.0:
            raise ServiceError(f"{name}: the yaw is {request.yaw:g}; expected 0, which is held")
        start = self._place(led)
        end = start + goal if request.relative else np.array(goal)
        try:
            led.way = Way(start, end, duration)
        except RefusalError as reason:
            raise ServiceError(f"{name}: {reason}") from None
        led.way_time = 0.0
        return GoToResponse()

    def _place(self, led):
        # Where it is told to be, if it is about there: otherwise every way would begin with a jerk.
        place = _position(led.state)
        told = place if led.wanted is None else _position(led.wanted)
        return told if np.linalg.norm(told - place) < led.vehicle.buffer else place

    def _on_way_timer(self):
        for led in self._seen:
            if led.way is None or led.waits:
                continue
            led.way_time += self._parameters.way_period
            position, velocity = led.way.at(led.way_time)
            self._want(led, self._reference(position, velocity))
            if led.way_time >= led.way.duration:
                led.way = None

    def _reference(self, position, velocity):
        message = PositionVelocityStateStamped()
        message.header.stamp = self._handle.stamp()
        message.header.frame_id = self._fixed_frame
        message.state = PositionVelocityState(*map(float, position), *map(float, velocity))
        return message

    # Distances.

    def _knows(self, led):
        age = self._handle.time() - led.state_time
        is_fresh = led.state is not None and 0.0 <= age < STATE_LIMIT
        return is_fresh and bool(np.isfinite(_position(led.state)).all())

    def _on_watch_timer(self):
        n = len(self._seen)
        positions, velocities, goals = (np.full((n, 3), np.nan) for _ in range(3))
        for k, led in enumerate(self._seen):
            if led.state is None or led.flight_state not in _WATCHED:
                continue
            positions[k] = goals[k] = _position(led.state)
            velocities[k] = led.state.state.x_dot, led.state.state.y_dot, led.state.state.z_dot
            if led.way is not None:
                goals[k] = led.way.at(led.way_time + LOOK_AHEAD)[0]
            elif led.wanted is not None:
                goals[k] = _position(led.wanted)
        waiting, close = self._separation.waiting(positions, velocities, goals)
        for pair in close:
            self._warn(pair)
        for led, waits in zip(self._seen, waiting.tolist(), strict=True):
            if waits != led.waits and led.publisher is not None:
                self._turn(led, waits)
        self._tell()

    def _turn(self, led, waits):
        led.waits = waits
        if waits:
            led.publisher.publish(self._reference(_position(led.state), np.zeros(3)))
        elif led.wanted is not None and led.way is None:
            state = led.wanted.state
            # Anew, since a controller does not go back to what is older than the place to wait.
            velocity = (state.x_dot, state.y_dot, state.z_dot)
            led.publisher.publish(self._reference(_position(led.wanted), velocity))

    def _warn(self, pair):
        first, second = (self._seen[k].vehicle.name for k in (pair.first, pair.second))
        self._handle.warn(
            f"{first} and {second} are {pair.distance:.2f} m apart and must not come closer than "
            f"{pair.limit:.2f} m: whom its reference leads nearer waits",
            throttle=1.0,
            key=(pair.first, pair.second),
        )

    def _tell(self):
        told = " ".join(led.vehicle.name for led in self._seen if led.waits)
        if told != self._told:
            self._told = told
            self._waiting.publish(String(told))


def _position(message):
    return np.array([message.state.x, message.state.y, message.state.z])
