"""What is known of a vehicle by its topics."""

import math
from functools import partial
from typing import NamedTuple

from geometry_msgs.msg import PoseStamped

from crazyflie_fleet.conversions import heading
from crazyflie_model.angles import Triple, quaternion_from_rpy
from crazyflie_model.supervisor import SupervisorState
from crazyflie_msgs.msg import FlightStatus, PositionVelocityYawStateStamped, VehicleStatus
from crazyflie_takeoff.motion import MAX_POSITION_AGE
from crazyflie_utils import NodeHandle, TransformError
from crazyflie_utils.flight_status import WORDS
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP_SIMULATED

_LANDED_HEIGHT = 0.1  #: Above the start, m: a vehicle below has landed.
#: States after a flight.
_ENDED = (FlightStatus.ON_GROUND, FlightStatus.LANDING, FlightStatus.DESCENDING)


class Pose(NamedTuple):
    """Position (m), rotation (quaternion x, y, z, w) and their time (s)."""

    position: Triple
    rotation: tuple[float, float, float, float]
    time: float


def velocity_between(first: Pose, last: Pose) -> Triple:
    """Return the mean velocity, m/s, from one pose to a later one."""
    span = last.time - first.time
    x, y, z = ((b - a) / span for a, b in zip(first.position, last.position, strict=True))
    return x, y, z


class RosVehicleState:
    """Where a vehicle is, whether it can fly on, and whether it has landed.

    The driver publishes its pose and status; otherwise the takeoff server its status, and an
    estimator its state. ``frames`` are the fixed and its own frame, if its position comes by tf;
    with the driver only as long as there are no poses. ``has_yaw`` is whether it can have another
    heading than 0.
    """

    def __init__(
        self,
        name: str,
        handle: NodeHandle,
        uses_driver: bool,
        frames: tuple[str, str] | None,
        has_yaw: bool,
    ):
        self.name = name
        self._handle = handle
        self.uses_driver = uses_driver
        self.has_yaw = has_yaw
        #: flight_status, driver_status: The last ones.
        self.flight_status = FlightStatus()
        self.driver_status = VehicleStatus(link=VehicleStatus.CONNECTING)
        self._pose: Pose | None = None
        self._seen_at = -math.inf
        # Of the last takeoff, m, and of the last landing, s.
        self._ground = 0.0
        self._landing_end = 0.0
        top = prefix(name)
        self._lookup = None if frames is None else partial(handle.listen_to_poses(), *frames)
        if uses_driver:
            handle.subscribe(f"{top}/pose", PoseStamped, self._on_pose, finite="pose")
            handle.subscribe(f"{top}/vehicle_status", VehicleStatus, self._on_driver_status)
            return
        if frames is None:
            state = PositionVelocityYawStateStamped
            handle.subscribe(f"{top}/state", state, self._on_state, finite="state")
        topic = f"{top}/in_flight_flight_status"
        handle.subscribe(topic, FlightStatus, self._on_flight_status)

    def position(self) -> Triple | None:
        """Return the position, m; None when it is not known."""
        pose = self.pose()
        return None if pose is None else pose.position

    def heading(self) -> float:
        """Return the heading, rad; 0 when it is not known, or cannot change."""
        pose = self.pose() if self.has_yaw else None
        return 0.0 if pose is None else heading(*pose.rotation)

    def pose(self) -> Pose | None:
        """Return where the vehicle is; None when that is not known."""
        if self._handle.time() - self._seen_at < MAX_POSITION_AGE:
            return self._pose
        if self._lookup is None:
            return None
        try:
            pose = self._lookup()
        except TransformError:
            return None
        # tf keeps the last pose of a vehicle that is not tracked any more.
        age = (self._handle.nanoseconds() - pose.stamp) * 1e-9
        # A pose far ahead of now is one from before the clock was set back.
        if not -MAX_FUTURE_STAMP_SIMULATED <= age < MAX_POSITION_AGE:
            return None
        return Pose(pose.position, pose.rotation, pose.stamp * 1e-9)

    def fault(self) -> str:
        """Return why the vehicle cannot fly on; empty if it can."""
        if self.uses_driver:
            status = self.driver_status
            cannot_fly_on = (
                status.link in (VehicleStatus.LOST, VehicleStatus.DISCONNECTED)
                or status.is_emergency
                or SupervisorState(status.supervisor).faults
                # The driver lands it.
                or status.battery == VehicleStatus.BATTERY_CRITICAL
            )
            return status.text if cannot_fly_on else ""
        flight = self.flight_status
        if flight.state in _ENDED:
            return f"it does not fly any more: {flight.reason or WORDS[flight.state]}"
        return ""

    def has_landed(self) -> bool:
        """Return whether the vehicle is on the ground, with its motors off."""
        if not self.uses_driver:
            return self.flight_status.state == FlightStatus.ON_GROUND
        place = self.position()
        if place is None:
            status = self.driver_status
            state = SupervisorState(status.supervisor)
            is_down = (
                status.link == VehicleStatus.CONNECTED
                and status.has_supervisor
                and not status.is_emergency
                and not state.faults
                and SupervisorState.FLYING not in state
            )
        else:
            is_down = place[2] < self._ground + _LANDED_HEIGHT
        # Then the mission stops the motors: not in the last centimetres.
        return is_down and self._handle.time() >= self._landing_end

    def _on_pose(self, message):
        p, q = message.pose.position, message.pose.orientation
        self._seen_at = self._handle.time()
        self._pose = Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w), self._seen_at)

    def _on_state(self, message):
        s = message.state
        self._seen_at = self._handle.time()
        rotation = quaternion_from_rpy(0.0, 0.0, s.yaw)
        self._pose = Pose((s.x, s.y, s.z), rotation, self._seen_at)

    def _on_flight_status(self, message):
        self.flight_status = message

    def _on_driver_status(self, message):
        self.driver_status = message


def prefix(name: str) -> str:
    """Return the namespace of a vehicle; that of "/" is the root."""
    return "" if name == "/" else f"/{name}"
