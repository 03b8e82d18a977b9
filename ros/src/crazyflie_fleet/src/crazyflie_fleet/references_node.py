"""ROS interface of straight moves, and of the collision avoidance."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToResponse
from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_fleet.lander import LANDING_TOPIC
from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_fleet.straight_move import StraightMove, evaluate
from crazyflie_fleet.vehicle_nodes import REFERENCE, SAFE_REFERENCE
from crazyflie_fleet.vehicle_states import VehicleStates
from crazyflie_msgs.msg import FlightStatus, PositionVelocityState, PositionVelocityStateStamped
from crazyflie_takeoff.motion import MAX_POSITION_AGE
from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter
from crazyflie_utils.parameters.types import TIME_STEP, TOPIC
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.topics import Publisher
from crazyflie_utils.vectors import is_finite, to_tuple

SILENCE_PERIOD = 5.0  #: Period of warnings about a vehicle whose states do not come (s).


class ReferencesParameters(Parameters):
    """Parameters of `ReferencesNode`."""

    move_period: float = parameter(
        TIME_STEP, "from one reference of a straight move to the next", 0.02, "way_period"
    )
    watch_period: float = parameter(TIME_STEP, "from one check of the distances to the next", 0.05)
    held_topic: str = parameter(
        TOPIC, "names of the vehicles that are held", "/fleet/waiting", "topics/waiting"
    )


@dataclass
class _TrackedVehicle:
    """A vehicle whose references pass through the node; times are in s."""

    number: int
    name: str
    buffer: float
    publisher: Publisher
    commanded: PositionVelocityStateStamped | None = None
    move: StraightMove | None = None
    move_time: float = 0.0
    is_held: bool = False
    is_to_land: bool = False
    # End of its takeoffs by the fleet file, if the file has no start point for it (m).
    hover_point: tuple[float, float, float] | None = None


class ReferencesNode(Node):
    """Passes on the references of vehicles, unless they lead one too near to another.

    ``vehicles`` are flown in this process and keep apart from ``others``, flown elsewhere, too.
    ``vectorized`` are topics with the states of several vehicles in one message. The attribute
    ``states`` has those of all. Vehicles named in ``unplaced`` take off from where they are seen.
    """

    needed_in_flight = True

    def __init__(
        self,
        vehicles: tuple[VehicleConfig, ...],
        others: tuple[VehicleConfig, ...],
        fixed_frame: str,
        vectorized: Mapping[str, tuple[VehicleConfig, ...]] | None = None,
        unplaced: Collection[str] = (),
    ):
        self._unplaced = unplaced
        self._vehicles = vehicles
        self._fixed_frame = fixed_frame
        # Own ones first.
        all_vehicles = (*vehicles, *others)
        self.states = VehicleStates(all_vehicles, vectorized or {})
        self._separation = Separation([vehicle.buffer for vehicle in all_vehicles])
        self._tracked: list[_TrackedVehicle] = []
        self._published_held = ""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(ReferencesParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._held = handle.publisher(parameters.held_topic, String, latch=True)
        self._publish_mocap_frames(handle)
        for vehicle in self._vehicles:
            self._track(handle, vehicle)
        self.states.subscribe(handle)
        handle.subscribe(LANDING_TOPIC, String, self._on_landing)
        handle.timer(parameters.move_period, self._on_move_timer)
        handle.timer(parameters.watch_period, self._on_watch_timer)

    def _track(self, handle, vehicle):
        top, message_type = f"/{vehicle.name}/", PositionVelocityStateStamped
        publisher = handle.publisher(top + SAFE_REFERENCE, message_type)
        tracked = _TrackedVehicle(len(self._tracked), vehicle.name, vehicle.buffer, publisher)
        if vehicle.name in self._unplaced:
            tracked.hover_point = vehicle.hover_point
        self._tracked.append(tracked)
        handle.advertise_service(top + "go_to", GoTo, partial(self._on_go_to, tracked))
        handle.subscribe(top + REFERENCE, message_type, partial(self._on_reference, tracked))

    def _publish_mocap_frames(self, handle):
        # The frame of motion capture is the frame of the vehicle, by another name.
        identity = Transform(Vector3(), Quaternion(w=1.0))
        transforms = [
            TransformStamped(Header(0, handle.stamp(), vehicle.mocap_frame), vehicle.name, identity)
            for vehicle in self._vehicles
            if vehicle.mocap_frame != vehicle.name
        ]
        if transforms:
            static = handle.publisher("/tf_static", TFMessage, latch=True)
            static.publish(TFMessage(transforms))

    def _is_flying(self, tracked):
        return self.states.flight_states[tracked.number] == FlightStatus.FLYING

    # References.

    def _on_landing(self, message):
        names = message.data.split()
        for tracked in self._tracked:
            is_to_land = tracked.name in names
            if is_to_land and not tracked.is_to_land and self._is_flying(tracked):
                # It hovers until its turn; only the fleet moves it.
                tracked.move = None
                self._command(tracked, self._reference(self._present(tracked), np.zeros(3)))
            tracked.is_to_land = is_to_land

    def _on_reference(self, tracked, message):
        if tracked.is_to_land and self._is_flying(tracked):
            return
        if not is_finite(message.state):
            # The controller handles invalid references.
            tracked.publisher.publish(message)
            return
        if tracked.hover_point == to_tuple(message.state)[:3]:
            x, y, z = self.states.positions[tracked.number].tolist()
            hover = np.array([x, y, max(z, tracked.hover_point[2])])
            message = self._reference(hover, np.zeros(3))
        tracked.move = None
        self._command(tracked, message)

    def _command(self, tracked, message):
        tracked.commanded = message
        if not tracked.is_held:
            tracked.publisher.publish(message)

    def _reference(self, position, velocity):
        message = PositionVelocityStateStamped()
        message.header.stamp = self._handle.stamp()
        message.header.frame_id = self._fixed_frame
        message.state = PositionVelocityState(*position.tolist(), *velocity.tolist())
        return message

    # Straight moves.

    def _on_go_to(self, tracked, request):
        goal = (request.goal.x, request.goal.y, request.goal.z)
        name = f"/{tracked.name}/go_to refused"
        if not (self._is_flying(tracked) and self.states.are_fresh()[tracked.number]):
            raise ServiceError(f"{name}: the vehicle is not in flight")
        if not np.isfinite(goal).all():
            raise ServiceError(f"{name}: the goal is {goal}; expected finite numbers (m)")
        if request.yaw != 0.0:
            raise ServiceError(f"{name}: the yaw is {request.yaw:g}; expected 0, which is held")
        start = self._present(tracked)
        end = start + goal if request.relative else np.array(goal)
        velocity = self._present_velocity(tracked, start)
        try:
            tracked.move = StraightMove(start, end, request.duration.to_sec(), velocity)
        except RefusalError as reason:
            raise ServiceError(f"{name}: {reason}") from None
        tracked.move_time = 0.0
        return GoToResponse()

    def _present(self, tracked):
        """Return the commanded position; the measured one if the vehicle is not near it, m."""
        measured = self.states.positions[tracked.number].copy()
        commanded = measured if tracked.commanded is None else _position(tracked.commanded)
        return commanded if np.linalg.norm(commanded - measured) < tracked.buffer else measured

    def _present_velocity(self, tracked, position):
        if tracked.is_held:
            return np.zeros(3)
        if tracked.commanded is not None and np.array_equal(position, _position(tracked.commanded)):
            return np.array(to_tuple(tracked.commanded.state)[3:])
        return np.nan_to_num(self.states.velocities[tracked.number])

    def _on_move_timer(self):
        fresh = self.states.are_fresh()
        moving = []
        for tracked in self._tracked:
            if not self._is_flying(tracked):
                tracked.move = None
            # A move stops while its vehicle is held, or no state of it comes.
            if tracked.move is not None and not tracked.is_held and fresh[tracked.number]:
                tracked.move_time += self._parameters.move_period
                moving.append(tracked)
        if not moving:
            return
        for tracked, position, velocity in zip(moving, *_evaluate(moving), strict=True):
            self._command(tracked, self._reference(position, velocity))
            if tracked.move_time >= tracked.move.duration:
                tracked.move = None

    # Distances.

    def _on_watch_timer(self):
        in_flight, fresh = self.states.are_in_flight(), self.states.are_fresh()
        positions = np.where(in_flight[:, None], self.states.positions, np.nan)
        # An old velocity does not say where a vehicle will be.
        velocities = np.where(fresh[:, None], self.states.velocities, 0.0)
        for number in np.flatnonzero(in_flight & ~fresh).tolist():
            self._warn_of_silence(number)
        goals = positions.copy()
        moving = [tracked for tracked in self._tracked if tracked.move is not None]
        for tracked in self._tracked:
            if tracked.commanded is not None and tracked.move is None:
                goals[tracked.number] = _position(tracked.commanded)
        if moving:
            goals[[tracked.number for tracked in moving]] = _evaluate(moving, LOOK_AHEAD)[0]
        held, close = self._separation.update(positions, velocities, goals)
        for pair in close:
            self._warn_of_pair(pair)
        for tracked in self._tracked:
            if held[tracked.number] and not tracked.is_held:
                self._hold(tracked)
            elif tracked.is_held and not held[tracked.number]:
                self._release(tracked)
        self._publish_held()

    def _hold(self, tracked):
        tracked.is_held = True
        position = self.states.positions[tracked.number]
        tracked.publisher.publish(self._reference(position, np.zeros(3)))

    def _release(self, tracked):
        tracked.is_held = False
        if tracked.commanded is not None and tracked.move is None:
            # With a new stamp: a controller ignores what is older than the hold.
            state = np.array(to_tuple(tracked.commanded.state))
            tracked.publisher.publish(self._reference(state[:3], state[3:]))

    def _publish_held(self):
        held = " ".join(tracked.name for tracked in self._tracked if tracked.is_held)
        if held != self._published_held:
            self._published_held = held
            self._held.publish(String(held))

    def _warn_of_pair(self, pair):
        first, second = (self.states.names[k] for k in (pair.first, pair.second))
        self._handle.warn(
            f"{first} and {second} are {pair.distance:.2f} m apart and must not come closer than "
            f"{pair.limit:.2f} m: a vehicle whose reference approaches the other is held",
            throttle=1.0,
            key=(pair.first, pair.second),
        )

    def _warn_of_silence(self, number):
        name, position = self.states.names[number], self.states.positions[number]
        consequence = "the others cannot keep apart from it"
        if np.isfinite(position).all():
            x, y, z = position.tolist()
            consequence = f"the others keep apart from its last place, ({x:.2f}, {y:.2f}, {z:.2f})"
        self._handle.warn(
            f"{name} is in flight, and no state of it has come for {MAX_POSITION_AGE:g} s: its "
            f"position is not known; {consequence}",
            throttle=SILENCE_PERIOD,
            key=("silence", name),
        )


def _position(message):
    return np.array(to_tuple(message.state)[:3])


def _evaluate(moving, ahead=0.0):
    """Return positions and velocities on the moves of vehicles, a time (s) ahead of now."""
    moves = [tracked.move for tracked in moving]
    return evaluate(moves, [tracked.move_time + ahead for tracked in moving])
