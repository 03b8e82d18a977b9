"""The vehicles of a fleet: their states, and their references, which keep them apart."""

import contextlib
import math
from collections import defaultdict
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, Header, String
from typing_extensions import override

from crazyflie_fleet.fleet_config import FleetConfig, VehicleConfig, close_pairs
from crazyflie_fleet.high_level_services import reference_message
from crazyflie_fleet.landing_rounds import SafeDescents
from crazyflie_fleet.separation import LOOK_AHEAD, Separation
from crazyflie_fleet.vehicle_nodes import (
    DESCENT,
    FLIGHT_STATUS,
    INHIBITION,
    REFERENCE,
    SAFE_DESCENT,
    SAFE_REFERENCE,
    STATE,
)
from crazyflie_model.angles import Triple
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_msgs.msg import PositionVelocityYawStateStamped as Reference
from crazyflie_takeoff.motion import MAX_POSITION_AGE
from crazyflie_utils import Node, NodeHandle, Parameters, TransformError, parameter, topic
from crazyflie_utils.parameters.types import TIME_STEP
from crazyflie_utils.refusal import distinct
from crazyflie_utils.tf.frame_tree import StampedPose
from crazyflie_utils.timers import Timer
from crazyflie_utils.topics import Publisher
from crazyflie_utils.vectors import is_finite, to_tuple

_IN_FLIGHT = (FlightStatus.TAKING_OFF, FlightStatus.FLYING, FlightStatus.DESCENDING)


class VehicleStates:
    """The last states and flight states of vehicles, which have numbers in the order given.

    ``vectorized`` are topics with the states of several of them in one message. ``obstacles``
    are not flown: their numbers follow, and `update_obstacles` takes their positions from tf.
    """

    def __init__(
        self,
        vehicles: Sequence[VehicleConfig],
        vectorized: Mapping[str, Sequence[VehicleConfig]],
        obstacles: Sequence[VehicleConfig] = (),
    ):
        self._obstacles = obstacles
        everyone = [*vehicles, *obstacles]
        self.names = [vehicle.name for vehicle in everyone]
        #: Name to number.
        self.numbers = {name: number for number, name in enumerate(self.names)}
        #: Shape (n,); `FlightStatus.state` of each; UNKNOWN before the first.
        self.flight_states = np.full(len(everyone), FlightStatus.UNKNOWN)
        #: Shape (n,); which are obstacles.
        self.are_obstacles = np.arange(len(everyone)) >= len(vehicles)
        #: Reason for which each vehicle would refuse a takeoff; empty if it would not.
        self.takeoff_refusals = [
            f"nothing has come on /{name}/{FLIGHT_STATUS}" for name in self.names
        ]
        self._vectorized = vectorized
        self._lookups: dict[int, Callable[[], StampedPose]] = {}
        self._states = np.full((len(everyone), 7), np.nan)
        self._times = np.full(len(everyone), -np.inf)
        #: positions, velocities, headings: Shapes (n, 3), (n, 3) and (n,), m, m/s and rad, fixed
        #: frame; NaN before the first.
        self.positions: NDArray[np.float64] = self._states[:, :3]
        self.velocities: NDArray[np.float64] = self._states[:, 3:6]
        self.headings: NDArray[np.float64] = self._states[:, 6]

    def subscribe(self, handle: NodeHandle, frame: str) -> None:
        """Subscribe to the topics of all vehicles; ``frame`` is the fixed frame, of obstacles."""
        self._handle = handle
        flown = np.flatnonzero(~self.are_obstacles).tolist()
        scalar = {self.names[number]: number for number in flown}
        for name, number in scalar.items():
            on_status = partial(self._on_flight_status, number)
            handle.subscribe(f"/{name}/{FLIGHT_STATUS}", FlightStatus, on_status)
        if self._obstacles:
            lookup = handle.listen_to_poses()
            self._lookups = {
                self.numbers[each.name]: partial(lookup, frame, each.mocap_frame)
                for each in self._obstacles
            }
        for name, vehicles in self._vectorized.items():
            numbers = np.array([scalar.pop(vehicle.name) for vehicle in vehicles])
            handle.subscribe(name, Float64MultiArray, partial(self._on_states, numbers))
        for name, number in scalar.items():
            on_state = partial(self._on_state, number)
            handle.subscribe(f"/{name}/{STATE}", PositionVelocityYawStateStamped, on_state)

    def update_obstacles(self) -> None:
        """Take the last poses of obstacles from tf; the velocity is that between two of them."""
        now, clock = self._handle.time(), self._handle.nanoseconds()
        for number, lookup in self._lookups.items():
            # Before the first pose it is not known.
            with contextlib.suppress(TransformError):
                pose = lookup()
                # A static pose, that of a body which nothing measures, has no stamp.
                time = now - (clock - pose.stamp) * 1e-9 if pose.stamp else now
                passed = time - self._times[number]
                moved = np.array(pose.position) - self.positions[number]
                # The clock may have been set back.
                if passed != 0.0:
                    self.velocities[number] = np.nan_to_num(moved / passed) * (passed > 0.0)
                self.positions[number] = pose.position
                self._times[number] = time

    def flight_state(self, name: str) -> int:
        """Return `FlightStatus.state` of a vehicle."""
        return int(self.flight_states[self.numbers[name]])

    def are_fresh(self) -> NDArray[np.bool_]:
        """Return which positions are finite and younger than `MAX_POSITION_AGE`, shape (n,)."""
        age = self._handle.time() - self._times
        return (age >= 0.0) & (age < MAX_POSITION_AGE) & np.isfinite(self.positions).all(axis=1)

    def goal(self, number: int) -> Goal[float] | None:
        """Return position, velocity and heading of one vehicle as a goal; None if not fresh."""
        # Checked for one vehicle: among a hundred, `are_fresh` for all would take longer.
        age = self._handle.time() - self._times.item(number)
        x, y, z, *velocity, yaw = self._states[number].tolist()
        if not (0.0 <= age < MAX_POSITION_AGE and math.isfinite(x + y + z)):
            return None
        return Goal((x, y, z), tuple(velocity), (0.0, 0.0, 0.0), yaw, 0.0)

    def are_in_flight(self) -> NDArray[np.bool_]:
        """Return which vehicles are in flight, so that others must keep apart, shape (n,)."""
        return np.isin(self.flight_states, _IN_FLIGHT)

    def flying(self) -> set[str]:
        """Return the names of those in flight."""
        return {self.names[number] for number in np.flatnonzero(self.are_in_flight())}

    def _on_state(self, number, message):
        self._states[number] = to_tuple(message.state)
        self._times[number] = self._handle.time()

    def _on_states(self, numbers, message):
        if len(message.data) != 7 * len(numbers):
            self._handle.warn(
                f"ignoring {len(message.data)} numbers as states of {len(numbers)} vehicles",
                throttle=1.0,
                key="states",
            )
            return
        self._states[numbers] = np.reshape(message.data, (-1, 7))
        self._times[numbers] = self._handle.time()

    def _on_flight_status(self, number, message):
        self.flight_states[number] = message.state
        self.takeoff_refusals[number] = message.takeoff_refusal


#: Topic with the names of vehicles that only the fleet moves, until they land.
LANDING_TOPIC = "/fleet/landing"
_START_PERIOD = 0.2  #: Period of the checks of vehicles with one start point (s).
SILENCE_PERIOD = 5.0  #: Period of warnings about a vehicle whose states do not come (s).


class ReferencesParameters(Parameters):
    """Parameters of `ReferencesNode`."""

    watch_period: float = parameter(TIME_STEP, "from one check of the distances to the next", 0.05)
    held_topic: str = topic("waiting", "names of the vehicles that are held", "/fleet/waiting")


class SharedTimers:
    """Timers with callbacks of many vehicles: one of each period, which runs while it has any."""

    def __init__(self) -> None:
        self._callbacks: dict[float, list[Callable[[], None]]] = defaultdict(list)
        self._timers: dict[float, Timer] = {}

    def add(
        self, handle: NodeHandle, period: float, callback: Callable[[], None]
    ) -> Callable[[], None]:
        """Call ``callback()`` every ``period`` (s) from now on; return a function that ends it."""
        callbacks = self._callbacks[period]
        callbacks.append(callback)
        if len(callbacks) == 1:
            self._timers[period] = handle.timer(period, partial(_call_all, callbacks))
        return partial(self._remove, period, callback)

    def _remove(self, period, callback):
        self._callbacks[period].remove(callback)
        if not self._callbacks[period]:
            self._timers.pop(period).stop()


def _call_all(callbacks):
    for callback in [*callbacks]:
        callback()


class TrackedVehicle:
    """A vehicle whose references pass through `ReferencesNode`; its `HighLevelNode` gives some."""

    def __init__(
        self, config: VehicleConfig, states: VehicleStates, timers: SharedTimers, is_unplaced: bool
    ):
        self.name = config.name
        self.number = states.numbers[config.name]
        self._buffer = config.buffer
        self._timers = timers
        #: Place where it is kept, m, as another one is too near; None while it follows references.
        self.held_at: Triple | None = None
        self.is_to_land = False  #: Whether only the fleet moves it, until it lands.
        #: Called when the fleet, or another node, commands it.
        self.on_interruption: Callable[[], None] = lambda: None
        #: Called after the reference of another node.
        self.on_reference: Callable[[], None] = lambda: None
        #: Returns the position of its own references after a time (s), m; None if they do not move.
        self.ahead: Callable[[float], Triple | None] = lambda time: None
        #: End of its takeoffs by the fleet file, if the file has no start point for it (m).
        self.hover_point = config.hover_point if is_unplaced else None
        self._states = states
        self._commanded: Goal[float] | None = None
        #: Heading that was commanded, or measured, in this flight (rad); None before.
        self.heading: float | None = None
        # Own references that this node has not received yet, by their identity.
        self._own: dict[int, PositionVelocityStateStamped] = {}

    def register(self, handle: NodeHandle, frame: str) -> None:
        """Create the publishers and the subscriber; ``frame`` is the fixed frame."""
        top, message_type = f"/{self.name}/", PositionVelocityStateStamped
        self._handle, self._frame = handle, frame
        self._safe: Publisher = handle.publisher(top + SAFE_REFERENCE, Reference)
        #: Topic of its descents, see `ReferencesNode`.
        self.safe_descent: Publisher = handle.publisher(top + SAFE_DESCENT, Reference)
        self._public: Publisher = handle.publisher(top + REFERENCE, message_type)
        handle.subscribe(top + REFERENCE, message_type, self._on_reference)

    def goal(self) -> Goal[float] | None:
        """Return the measured state; None if it is not known."""
        return self._states.goal(self.number)

    def commanded(self) -> Goal[float] | None:
        """Return the last reference of any node; None if the vehicle is not near it."""
        goal, measured = self._commanded, self._states.positions[self.number]
        is_near = goal is not None and math.dist(goal.position, measured) < self._buffer
        return goal if is_near else None

    def follow(self, goal: Goal[float]) -> None:
        """Make the vehicle follow a goal, which is published as a reference, too."""
        header = Header(0, self._handle.stamp(), self._frame)
        self.heading = goal.yaw
        self._command(goal, header)
        if self._public.has_subscribers(excluding=1):
            message = reference_message(goal, has_yaw=False)
            message.header = header
            self._own[id(message)] = message
            self._public.publish(message)

    def timer(self, period: float, callback: Callable[[], None]) -> Callable[[], None]:
        """Call ``callback()`` every ``period`` (s), see `SharedTimers`; the result ends this."""
        return self._timers.add(self._handle, period, callback)

    def destination(self, time: float) -> Triple | None:
        """Return the position of the references after a time (s), m; None without references.

        Those of other nodes are taken at rest, since their continuation is not known.
        """
        ahead = self.ahead(time)
        if ahead is not None:
            return ahead
        return None if self._commanded is None else self._commanded.position

    def is_flying(self) -> bool:
        """Return whether it follows references."""
        return self._states.flight_states[self.number] == FlightStatus.FLYING

    def land(self, is_to_land: bool) -> None:
        """Hover until its turn to land: only the fleet moves it."""
        if is_to_land and not self.is_to_land and self.is_flying():
            self.on_interruption()
            goal = self.commanded() or at_rest(self._states.positions[self.number].tolist())
            self._command(at_rest(goal.position, self._present_heading()), None)
        self.is_to_land = is_to_land

    def hold(self) -> None:
        """Keep the vehicle at its position and ignore commands."""
        x, y, z = self._states.positions[self.number].tolist()
        self.held_at = (x, y, z)
        self._publish(at_rest(self.held_at, self._present_heading()))

    def release(self) -> None:
        """Follow the last reference again."""
        self.held_at = None
        if self._commanded is not None:
            # With a new stamp: a controller ignores what is older than the hold.
            self._publish(self._commanded)

    def _on_reference(self, message):
        # It may come after later ones were published.
        is_own = self._own.pop(id(message), None) is not None
        if is_own or (self.is_to_land and self.is_flying()):
            return
        self.on_interruption()
        x, y, z, *rates = to_tuple(message.state)
        vx, vy, vz = rates
        if self.hover_point == (x, y, z):
            x, y, height = self._states.positions[self.number].tolist()
            z, vx, vy, vz = max(height, z), 0.0, 0.0, 0.0
        goal = Goal((x, y, z), (vx, vy, vz), (0.0,) * 3, self._present_heading(), 0.0)
        if is_finite(message.state):
            self._command(goal, message.header)
        else:
            # The controller handles invalid references.
            self._publish(goal, message.header)
        self.on_reference()

    def _command(self, goal, header):
        self._commanded = goal
        if self.held_at is None:
            self._publish(goal, header)

    def _publish(self, goal, header=None):
        message = reference_message(goal, has_yaw=True)
        message.header = header or Header(0, self._handle.stamp(), self._frame)
        self._safe.publish(message)

    def _present_heading(self):
        """Return the heading that references without one keep, rad."""
        if self.heading is None:
            heading = float(self._states.headings[self.number])
            if not math.isfinite(heading):
                return 0.0
            self.heading = heading
        return self.heading


class ReferencesNode(Node[ReferencesParameters]):
    """Passes on the references of vehicles, unless they lead one too near to another.

    Those named in ``names`` are flown in this process, and keep apart from all others of the fleet.
    References of descents are moved away from vehicles that are beneath. Vehicles with one start
    point in the fleet file must not take off until they have been measured apart, once, and take
    off from where they are seen. ``vectorized`` are topics with the states of several vehicles in
    one message. Obstacles have their initial positions if nothing measures them
    (``has_motion_capture``). The attribute ``states`` has the states of all, the vehicles of this
    process first.
    """

    needed_in_flight = True

    def __init__(
        self,
        fleet: FleetConfig,
        names: Collection[str],
        fixed_frame: str,
        vectorized: Mapping[str, tuple[VehicleConfig, ...]] | None = None,
        has_motion_capture: bool = True,
    ):
        self._has_motion_capture = has_motion_capture
        self._fixed_frame = fixed_frame
        self._configs = [each for each in fleet.vehicles if each.name in names]
        others = [each for each in fleet.vehicles if each.name not in names]
        self._obstacles = fleet.obstacles
        self.states = VehicleStates([*self._configs, *others], vectorized or {}, fleet.obstacles)
        everyone = [*self._configs, *others, *fleet.obstacles]
        self._buffers = [each.buffer for each in everyone]
        self._separation = Separation(self._buffers)
        self._descents = SafeDescents(self._buffers)
        self._descent_headings: dict[int, float] = {}  # Number to heading at the beginning (rad).
        self._close_starts = list(fleet.unplaced)
        unplaced = {name for pair in fleet.unplaced for name in pair}
        timers = SharedTimers()
        #: The vehicles of this process.
        self.vehicles = [
            TrackedVehicle(each, self.states, timers, each.name in unplaced)
            for each in self._configs
        ]
        # Topic to the text that was published last.
        self._published: dict[Publisher, str] = {}

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._held = handle.publisher(parameters.held_topic, String, latch=True)
        self._inhibitions = {
            each.name: handle.publisher(f"/{each.name}/{INHIBITION}", String, latch=True)
            for each in self.vehicles
            if each.hover_point is not None
        }
        self._publish_mocap_frames(handle)
        for tracked in self.vehicles:
            tracked.register(handle, self._fixed_frame)
            on_descent = partial(self._on_descent, tracked)
            topic = f"/{tracked.name}/{DESCENT}"
            handle.subscribe(topic, PositionVelocityStateStamped, on_descent)
        self.states.subscribe(handle, self._fixed_frame)
        handle.subscribe(LANDING_TOPIC, String, self._on_landing)
        handle.timer(parameters.watch_period, self._on_watch_timer)
        if self._inhibitions:
            self._check_starts()
            handle.timer(_START_PERIOD, self._check_starts)

    def _publish_mocap_frames(self, handle):
        # The frame of motion capture is the frame of the vehicle, by another name.
        identity = Transform(Vector3(), Quaternion(w=1.0))
        transforms = [
            TransformStamped(Header(0, handle.stamp(), vehicle.mocap_frame), vehicle.name, identity)
            for vehicle in (*self._configs, *self._obstacles)
            if vehicle.mocap_frame != vehicle.name
        ]
        if not self._has_motion_capture:
            transforms += [
                TransformStamped(
                    Header(0, handle.stamp(), self._fixed_frame),
                    obstacle.mocap_frame,
                    Transform(Vector3(*obstacle.position), Quaternion(w=1.0)),
                )
                for obstacle in self._obstacles
            ]
        if transforms:
            handle.broadcast_static_transforms()(transforms)

    def _publish(self, publisher, text):
        # The first is always published: others may still have that of a process before this one.
        if self._published.get(publisher) != text:
            self._published[publisher] = text
            publisher.publish(String(text))

    def _on_landing(self, message):
        names = message.data.split()
        for tracked in self.vehicles:
            tracked.land(tracked.name in names)

    # Distances.

    def _on_watch_timer(self):
        self.states.update_obstacles()
        in_flight, fresh = self.states.are_in_flight(), self.states.are_fresh()
        if in_flight.any():
            # Vehicles keep apart from obstacles, wherever these are.
            in_flight |= self.states.are_obstacles
        positions = np.where(in_flight[:, None], self.states.positions, np.nan)
        # An old velocity does not predict a vehicle's position.
        velocities = np.where(fresh[:, None], self.states.velocities, 0.0)
        for number in np.flatnonzero(in_flight & ~fresh).tolist():
            self._warn_of_silence(number)
        goals = positions.copy()
        for tracked in self.vehicles:
            if (destination := tracked.destination(LOOK_AHEAD)) is not None:
                goals[tracked.number] = destination
        held, close = self._separation.update(positions, velocities, goals)
        for pair in close:
            self._warn_of_pair(pair)
        for tracked in self.vehicles:
            if not in_flight[tracked.number]:
                tracked.heading = None
            if held[tracked.number] and tracked.held_at is None:
                tracked.hold()
            elif tracked.held_at is not None and not held[tracked.number]:
                tracked.release()
        waiting = [tracked.name for tracked in self.vehicles if tracked.held_at is not None]
        self._publish(self._held, " ".join(waiting))

    def _warn_of_pair(self, pair):
        first, second = (self.states.names[k] for k in (pair.first, pair.second))
        distance, limit = distinct(pair.distance, pair.limit)
        self._handle.warn(
            f"{first} and {second} are {distance} m apart and must not come closer than "
            f"{limit} m: a vehicle whose reference approaches the other is held",
            throttle=1.0,
            key=(pair.first, pair.second),
        )

    def _warn_of_silence(self, number):
        name, position = self.states.names[number], self.states.positions[number]
        what = "is not flown" if self.states.are_obstacles[number] else "is in flight"
        consequence = "the others cannot keep apart from it"
        if np.isfinite(position).all():
            x, y, z = position.tolist()
            consequence = f"the others keep apart from its last place, ({x:.2f}, {y:.2f}, {z:.2f})"
        self._handle.warn(
            f"{name} {what}, and no state of it has come for {MAX_POSITION_AGE:g} s: its "
            f"position is not known; {consequence}",
            throttle=SILENCE_PERIOD,
            key=("silence", name),
        )

    # Starts and landings.

    def _check_starts(self):
        reasons = {pair: self._takeoff_refusal(pair) for pair in self._close_starts}
        self._close_starts = [pair for pair, reason in reasons.items() if reason]
        for name, publisher in self._inhibitions.items():
            text = next((reasons[pair] for pair in self._close_starts if name in pair), "")
            self._publish(publisher, text)

    def _takeoff_refusal(self, pair):
        """Return why the vehicles of a pair must not take off; empty if they are apart."""
        numbers = [self.states.numbers[name] for name in pair]
        what = f"{pair[0]} and {pair[1]} start at one place by the fleet file"
        if not self.states.are_fresh()[numbers].all():
            return f"{what}, and the positions of both are not known"
        buffers = [self._buffers[number] for number in numbers]
        for _, _, distance, limit in close_pairs(self.states.positions[numbers], buffers):
            shown, least = distinct(distance, limit)
            return f"{what}, and are {shown} m apart; expected at least {least} m"
        return ""

    def _on_descent(self, tracked, message):
        now, states, number = self._handle.time(), self.states, tracked.number
        if not self._descents.is_under_way(number, now):
            is_descending = states.flight_states == FlightStatus.DESCENDING
            is_landing = is_descending | ~states.are_in_flight()
            distance = self._descents.begin(number, now, states.positions, is_landing)
            self._descent_headings[number] = float(np.nan_to_num(states.headings[number]))
            if distance > 0.0:
                self._handle.warn(
                    f"{tracked.name} lands {distance:.2f} m aside: another vehicle is beneath it"
                )
        aside = self._descents.reference(number, now, message.state.z, message.state.z_dot)
        numbers = to_tuple(message.state) if aside is None else aside
        state = PositionVelocityYawState(*numbers, self._descent_headings[number])
        tracked.safe_descent.publish(Reference(message.header, state))
