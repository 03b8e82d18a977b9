"""A vehicle behind the driver, as `crazyflie_py.separation_watch` holds and releases it."""

import math

from geometry_msgs.msg import Point

from crazyflie_driver import srv
from crazyflie_fleet.separation import LOOK_AHEAD
from crazyflie_mission_api.ros_vehicle import Pose, RosVehicle, seconds
from crazyflie_model.angles import Triple
from crazyflie_msgs.msg import VehicleStatus
from crazyflie_py.ros_connection import Connection
from crazyflie_py.setpoints import Attitude, MotorsOff, Position, Setpoint, led_to

_HOLD_DURATION = 0.8  #: In which a vehicle that is held stops, s.
#: Age of a setpoint at which the firmware levels out, s (commander.h, WDT_TIMEOUT_STABILIZE).
_SETPOINT_TIMEOUT = 0.5


class HeldVehicle:
    """One vehicle."""

    def __init__(self, vehicle: RosVehicle, connection: Connection):
        self.name = vehicle.name
        #: is_landing, avoids: Whether it lands, and whether its firmware avoids collisions; it is
        #: not held then.
        self.is_landing = False
        self.avoids = False
        self._free_until = -math.inf
        self._vehicle = vehicle
        self._connection = connection
        # The last setpoint, and when it came, s; where the vehicle is held, m.
        self._streamed: tuple[Setpoint, float] | None = None
        self._held_at: Triple | None = None

    def passed(self, setpoint: Setpoint) -> Setpoint:
        """Return the setpoint to send in place of one that a script sends."""
        self._streamed = setpoint, self._connection.fleet.time()
        if self._held_at is None or isinstance(setpoint, Attitude | MotorsOff):
            return setpoint
        return Position(self._held_at, self._vehicle.heading())

    def free(self, duration: float) -> None:
        """Note that it takes off or lands, for a duration (s)."""
        self._free_until = self._connection.fleet.time() + duration

    def end_setpoints(self) -> None:
        """Note that a command follows setpoints."""
        self._streamed = self._held_at = None

    @property
    def may_be_held(self) -> bool:
        """Whether it flies, and neither takes off, nor lands, nor avoids others by itself."""
        is_flying = bool(self._vehicle.driver_status.supervisor & VehicleStatus.FLYING)
        is_free = self._connection.fleet.time() < self._free_until
        return is_flying and not is_free and not self.is_landing and not self.avoids

    def pose(self) -> Pose | None:
        """Return where it is; None if that is not known."""
        return self._vehicle.pose()

    def streamed_goal(self, place: Triple) -> Triple | None:
        """Return where setpoints lead it from a place (m); None if none are sent."""
        if self._streamed is None:
            return None
        setpoint, time = self._streamed
        if self._connection.fleet.time() - time > _SETPOINT_TIMEOUT:
            return None
        return led_to(setpoint, place, self._vehicle.heading(), LOOK_AHEAD)

    def hold(self, place: Triple) -> None:
        """Have it stay at a place, m."""
        if self.streamed_goal(place) is not None:
            self._held_at = place
            return
        arguments = (0, False, Point(*place), self._vehicle.heading(), seconds(_HOLD_DURATION))
        self._vehicle.call("go_to", srv.GoTo, *arguments).add_done_callback(self._note_hold)

    def release(self) -> None:
        """Have it follow setpoints again."""
        self._held_at = None

    def _note_hold(self, answer):
        if answer.exception() is not None:
            self._connection.handle.warn(f"{self.name}: it cannot be held: {answer.exception()}")
