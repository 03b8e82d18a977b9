"""ROS interface of what leads vehicles along ways, and apart."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToResponse
from crazyflie_fleet.fleet import Vehicle
from crazyflie_fleet.lander import LANDING_TOPIC
from crazyflie_fleet.safe_descent import SafeDescents
from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_fleet.sightings import DESCENDING, FLYING, STATE_LIMIT, Sightings
from crazyflie_fleet.stack import DESCENT, REFERENCE, SAFE_DESCENT, SAFE_REFERENCE
from crazyflie_fleet.way import Way, along
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter
from crazyflie_utils.parameters.types import TIME_STEP, TOPIC
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.topics import Publisher
from crazyflie_utils.vectors import is_finite, to_tuple

SILENCE_PERIOD = 5.0
"""From one warning about a vehicle whose states do not come to the next, s."""


class ReferencesParameters(Parameters):
    """Parameters of `ReferencesNode`."""

    way_period: float = parameter(TIME_STEP, "from one reference of a way to the next", 0.02)
    watch_period: float = parameter(TIME_STEP, "from one look at the distances to the next", 0.05)
    waiting_topic: str = parameter(TOPIC, "who waits for whom", "/fleet/waiting", "topics/waiting")


@dataclass
class _Led:
    """A vehicle that is led; times are in s."""

    number: int
    vehicle: Vehicle
    publisher: Publisher
    wanted: PositionVelocityStateStamped | None = None
    way: Way | None = None
    way_time: float = 0.0
    waits: bool = False
    is_landed: bool = False


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

    Attributes
    ----------
    sightings : Sightings
        Of all of them.
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
        self._fixed_frame = fixed_frame
        # Own ones first.
        everybody = (*vehicles, *others)
        self.sightings = Sightings(everybody, swarms or {})
        buffers = [vehicle.buffer for vehicle in everybody]
        self._separation = Separation(buffers)
        self._descents = SafeDescents(buffers)
        self._led: list[_Led] = []
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
        self.sightings.subscribe(handle)
        handle.subscribe(LANDING_TOPIC, String, self._on_landing)
        handle.timer(parameters.way_period, self._on_way_timer)
        handle.timer(parameters.watch_period, self._on_watch_timer)

    def _lead(self, handle, vehicle):
        below = f"/{vehicle.name}/"
        publisher = handle.publisher(below + SAFE_REFERENCE, PositionVelocityStateStamped)
        led = _Led(len(self._led), vehicle, publisher)
        self._led.append(led)
        handle.advertise_service(below + "go_to", GoTo, partial(self._on_go_to, led))
        handle.subscribe(
            below + REFERENCE, PositionVelocityStateStamped, partial(self._on_reference, led)
        )
        descent = handle.publisher(below + SAFE_DESCENT, PositionVelocityStateStamped)
        handle.subscribe(
            below + DESCENT, PositionVelocityStateStamped, partial(self._on_descent, led, descent)
        )

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

    # References.

    def _on_landing(self, message):
        names = message.data.split()
        for led in self._led:
            is_landed = led.vehicle.name in names
            if is_landed and not led.is_landed and self._is_flying(led):
                # Until its turn it stays; the fleet moves it if something is beneath it.
                led.way = None
                self._want(led, self._reference(self._place(led), np.zeros(3)))
            led.is_landed = is_landed

    def _on_reference(self, led, message):
        if led.is_landed and self._is_flying(led):
            return
        if not is_finite(message.state):
            # What is to be done about it is the controller's business.
            led.publisher.publish(message)
            return
        led.way = None
        self._want(led, message)

    def _on_descent(self, led, publisher, message):
        number, now = led.number, self._handle.time()
        if number not in self._descents:
            flight_states = np.array(self.sightings.flight_states)
            is_landing = ~self.sightings.are_in_flight() | (flight_states == DESCENDING)
            distance = self._descents.begin(number, now, self.sightings.positions, is_landing)
            if distance > 0.0:
                self._handle.warn(
                    f"{led.vehicle.name} lands {distance:.2f} m aside: another is beneath it"
                )
        aside = self._descents.reference(number, now, message.state.z, message.state.z_dot)
        if aside is not None:
            message = PositionVelocityStateStamped(message.header, PositionVelocityState(*aside))
        publisher.publish(message)

    def _want(self, led, message):
        led.wanted = message
        if not led.waits:
            led.publisher.publish(message)

    # Ways.

    def _on_go_to(self, led, request):
        goal = (request.goal.x, request.goal.y, request.goal.z)
        duration = request.duration.to_sec()
        name = f"/{led.vehicle.name}/go_to refused"
        if not (self._is_flying(led) and self.sightings.are_fresh()[led.number]):
            raise ServiceError(f"{name}: the vehicle is not in flight")
        if not np.isfinite(goal).all():
            raise ServiceError(f"{name}: the goal is {goal}; expected finite numbers (m)")
        if request.yaw != 0.0:
            raise ServiceError(f"{name}: the yaw is {request.yaw:g}; expected 0, which is held")
        start = self._place(led)
        end = start + goal if request.relative else np.array(goal)
        try:
            led.way = Way(start, end, duration, self._velocity(led, start))
        except RefusalError as reason:
            raise ServiceError(f"{name}: {reason}") from None
        led.way_time = 0.0
        return GoToResponse()

    def _place(self, led):
        # Where it is told to be, if it is about there: otherwise every way would begin with a jerk.
        place = self.sightings.positions[led.number].copy()
        told = place if led.wanted is None else _position(led.wanted)
        return told if np.linalg.norm(told - place) < led.vehicle.buffer else place

    def _velocity(self, led, place):
        if led.waits:
            return np.zeros(3)
        if led.wanted is not None and np.array_equal(place, _position(led.wanted)):
            return np.array(to_tuple(led.wanted.state)[3:])
        return np.nan_to_num(self.sightings.velocities[led.number])

    def _is_flying(self, led):
        return self.sightings.flight_states[led.number] == FLYING

    def _on_way_timer(self):
        for led in self._led:
            if not self._is_flying(led):
                led.way = None
            if self.sightings.flight_states[led.number] != DESCENDING:
                self._descents.end(led.number)
        ways = {led.number: led.way for led in self._led if led.way is not None and not led.waits}
        if not ways:
            return
        fresh = self.sightings.are_fresh()
        # A vehicle that nobody sees is not led on.
        ways = {number: way for number, way in ways.items() if fresh[number]}
        if not ways:
            return
        going = [self._led[number] for number in ways]
        for led in going:
            led.way_time += self._parameters.way_period
        places = along([*ways.values()], [led.way_time for led in going])
        for led, way, position, velocity in zip(going, ways.values(), *places, strict=True):
            self._want(led, self._reference(position, velocity))
            if led.way_time >= way.duration:
                led.way = None

    def _reference(self, position, velocity):
        message = PositionVelocityStateStamped()
        message.header.stamp = self._handle.stamp()
        message.header.frame_id = self._fixed_frame
        message.state = PositionVelocityState(*position.tolist(), *velocity.tolist())
        return message

    # Distances.

    def _on_watch_timer(self):
        in_flight, fresh = self.sightings.are_in_flight(), self.sightings.are_fresh()
        positions = np.where(in_flight[:, None], self.sightings.positions, np.nan)
        # A speed of long ago does not say where a vehicle will be.
        velocities = np.where(fresh[:, None], self.sightings.velocities, 0.0)
        for number in np.flatnonzero(in_flight & ~fresh).tolist():
            self._warn_of_silence(number)
        goals = positions.copy()
        told = [led for led in self._led if led.wanted is not None and led.way is None]
        if told:
            goals[[led.number for led in told]] = [_position(led.wanted) for led in told]
        ways = {led.number: led.way for led in self._led if led.way is not None}
        if ways:
            soon = [self._led[number].way_time + LOOK_AHEAD for number in ways]
            goals[[*ways]] = along([*ways.values()], soon)[0]
        waiting, close = self._separation.waiting(positions, velocities, goals)
        for pair in close:
            self._warn(pair)
        for led in self._led:
            waits = bool(waiting[led.number])
            if waits != led.waits:
                self._turn(led, waits)
        self._tell()

    def _turn(self, led, waits):
        led.waits = waits
        if waits:
            place = self.sightings.positions[led.number]
            led.publisher.publish(self._reference(place, np.zeros(3)))
        elif led.wanted is not None and led.way is None:
            # Anew, since a controller does not go back to what is older than the place to wait.
            wanted = np.array(to_tuple(led.wanted.state))
            led.publisher.publish(self._reference(wanted[:3], wanted[3:]))

    def _warn(self, pair):
        first, second = (self.sightings.names[k] for k in (pair.first, pair.second))
        self._handle.warn(
            f"{first} and {second} are {pair.distance:.2f} m apart and must not come closer than "
            f"{pair.limit:.2f} m: whom its reference leads nearer waits",
            throttle=1.0,
            key=(pair.first, pair.second),
        )

    def _warn_of_silence(self, number):
        name = self.sightings.names[number]
        place = self.sightings.positions[number]
        keep = "the others cannot keep apart from it"
        if np.isfinite(place).all():
            x, y, z = place.tolist()
            keep = f"the others keep apart from where it was last, ({x:.2f}, {y:.2f}, {z:.2f})"
        self._handle.warn(
            f"{name} is {self.sightings.flight_states[number].replace('_', ' ')}, and no state of "
            f"it has come for {STATE_LIMIT:g} s: where it is, is not known; {keep}",
            throttle=SILENCE_PERIOD,
            key=("silence", name),
        )

    def _tell(self):
        told = " ".join(led.vehicle.name for led in self._led if led.waits)
        if told != self._told:
            self._told = told
            self._waiting.publish(String(told))


def _position(message):
    return np.array(to_tuple(message.state)[:3])
