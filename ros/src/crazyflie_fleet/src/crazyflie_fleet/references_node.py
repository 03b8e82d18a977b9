"""ROS interface of what leads vehicles along ways, and apart."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Float64MultiArray, Header, String
from tf2_msgs.msg import TFMessage
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToResponse
from crazyflie_fleet.fleet import Vehicle
from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_fleet.stack import FLIGHT_STATE, REFERENCE, SAFE_REFERENCE, STATE
from crazyflie_fleet.way import Way, along
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter
from crazyflie_utils.parameter_types import TIME_STEP, TOPIC
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.runtime.topics import Publisher
from crazyflie_utils.vectors import is_finite, to_tuple

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

    number: int
    vehicle: Vehicle
    publisher: Publisher | None = None
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
    swarms : mapping of str to sequence of Vehicle, optional
        Topics that have the states of some of them in one message.
    """

    needed_in_flight = True

    def __init__(
        self,
        vehicles: tuple[Vehicle, ...],
        others: tuple[Vehicle, ...],
        fixed_frame: str,
        swarms: Mapping[str, tuple[Vehicle, ...]] | None = None,
    ):
        self._vehicles = vehicles
        self._others = others
        self._fixed_frame = fixed_frame
        self._swarms = swarms or {}
        everybody = (*vehicles, *others)
        self._separation = Separation([vehicle.buffer for vehicle in everybody])
        # Own ones first.
        self._seen: list[_Led] = []
        # Of each: x, y, z, x_dot, y_dot, z_dot, and since when it is known.
        self._states = np.full((len(everybody), 6), np.nan)
        self._state_times = np.full(len(everybody), -np.inf)
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
            self._see(handle, _Led(len(self._seen), vehicle))
        self._see_states(handle)
        handle.timer(parameters.way_period, self._on_way_timer)
        handle.timer(parameters.watch_period, self._on_watch_timer)

    def _lead(self, handle, vehicle):
        below = f"/{vehicle.name}/"
        publisher = handle.publisher(below + SAFE_REFERENCE, PositionVelocityStateStamped)
        led = _Led(len(self._seen), vehicle, publisher)
        handle.advertise_service(below + "go_to", GoTo, partial(self._on_go_to, led))
        handle.subscribe(
            below + REFERENCE, PositionVelocityStateStamped, partial(self._on_reference, led)
        )
        self._see(handle, led)

    def _see(self, handle, led):
        topic = f"/{led.vehicle.name}/{FLIGHT_STATE}"
        handle.subscribe(topic, String, partial(self._on_flight_state, led))
        self._seen.append(led)

    def _see_states(self, handle):
        alone = {led.vehicle.name: led.number for led in self._seen}
        for topic, swarm in self._swarms.items():
            numbers = np.array([alone.pop(vehicle.name) for vehicle in swarm])
            handle.subscribe(topic, Float64MultiArray, partial(self._on_states, numbers))
        for name, number in alone.items():
            on_state = partial(self._on_state, number)
            handle.subscribe(f"/{name}/{STATE}", PositionVelocityYawStateStamped, on_state)

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

    def _on_state(self, number, message):
        self._states[number] = to_tuple(message.state)[:6]
        self._state_times[number] = self._handle.time()

    def _on_states(self, numbers, message):
        if len(message.data) != 7 * len(numbers):
            self._handle.warn(
                f"ignoring {len(message.data)} numbers as states of {len(numbers)} vehicles",
                throttle=1.0,
                key="states",
            )
            return
        self._states[numbers] = np.reshape(message.data, (-1, 7))[:, :6]
        self._state_times[numbers] = self._handle.time()

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
        place = self._states[led.number, :3]
        told = place if led.wanted is None else _position(led.wanted)
        return told if np.linalg.norm(told - place) < led.vehicle.buffer else place.copy()

    def _on_way_timer(self):
        going = [led for led in self._seen if led.way is not None and not led.waits]
        if not going:
            return
        for led in going:
            led.way_time += self._parameters.way_period
        places = along([led.way for led in going], [led.way_time for led in going])
        for led, position, velocity in zip(going, *places, strict=True):
            self._want(led, self._reference(position, velocity))
            if led.way_time >= led.way.duration:
                led.way = None

    def _reference(self, position, velocity):
        message = PositionVelocityStateStamped()
        message.header.stamp = self._handle.stamp()
        message.header.frame_id = self._fixed_frame
        message.state = PositionVelocityState(*position.tolist(), *velocity.tolist())
        return message

    # Distances.

    def _knows(self, led):
        age = self._handle.time() - self._state_times[led.number]
        return 0.0 <= age < STATE_LIMIT and bool(np.isfinite(self._states[led.number, :3]).all())

    def _on_watch_timer(self):
        positions, velocities = self._states[:, :3].copy(), self._states[:, 3:]
        positions[[led.flight_state not in _WATCHED for led in self._seen]] = np.nan
        goals = positions.copy()
        told = [led for led in self._seen if led.wanted is not None and led.way is None]
        if told:
            goals[[led.number for led in told]] = [_position(led.wanted) for led in told]
        going = [led for led in self._seen if led.way is not None]
        if going:
            soon = [led.way_time + LOOK_AHEAD for led in going]
            goals[[led.number for led in going]] = along([led.way for led in going], soon)[0]
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
            place = self._states[led.number, :3]
            led.publisher.publish(self._reference(place, np.zeros(3)))
        elif led.wanted is not None and led.way is None:
            # Anew, since a controller does not go back to what is older than the place to wait.
            wanted = np.array(to_tuple(led.wanted.state))
            led.publisher.publish(self._reference(wanted[:3], wanted[3:]))

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
    return np.array(to_tuple(message.state)[:3])
