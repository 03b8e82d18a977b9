"""A vehicle behind the driver, as `crazyflie_py.separation_watch` holds and releases it."""

import math

from geometry_msgs.msg import Point
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.separation import LOOK_AHEAD
from crazyflie_mission_api.ros_vehicle import RosVehicle, seconds
from crazyflie_mission_api.vehicle_state import Pose
from crazyflie_model.angles import Triple
from crazyflie_msgs.msg import VehicleStatus
from crazyflie_py.ros_connection import Connection
from crazyflie_py.separation_watch import WatchedVehicle
from crazyflie_py.setpoints import Attitude, MotorsOff, Position, Setpoint, led_to

_HOLD_DURATION = 0.8
"""In which a vehicle that is held stops, s."""

_SETPOINT_TIMEOUT = 0.5
"""Age of a setpoint at which the firmware levels out, s (commander.h, WDT_TIMEOUT_STABILIZE)."""


class HeldVehicle(WatchedVehicle):
    """One vehicle.

    Attributes
    ----------
    is_landing, avoids : bool
        Whether it lands, and whether its firmware avoids collisions; it is not held then.
    takeoff_end : float
        Before this time it is not held, s.
    """

    def __init__(self, vehicle: RosVehicle, connection: Connection):
        self.name = vehicle.name
        self.is_landing = False
        self.avoids = False
        self.takeoff_end = -math.inf
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

    def end_setpoints(self) -> None:
        """Note that a command follows setpoints."""
        self._streamed = self._held_at = None

    @property
    @override
    def may_be_held(self) -> bool:
        is_flying = bool(self._vehicle.driver_status.supervisor & VehicleStatus.FLYING)
        has_taken_off = self._connection.fleet.time() > self.takeoff_end
        return is_flying and has_taken_off and not self.is_landing and not self.avoids

    @override
    def pose(self) -> Pose | None:
        return self._vehicle.pose()

    @override
    def streamed_goal(self, place: Triple) -> Triple | None:
        if self._streamed is None:
            return None
        setpoint, time = self._streamed
        if self._connection.fleet.time() - time > _SETPOINT_TIMEOUT:
            return None
        return led_to(setpoint, place, self._vehicle.heading(), LOOK_AHEAD)

    @override
    def hold(self, place: Triple) -> None:
        if self.streamed_goal(place) is not None:
            self._held_at = place
            return
        arguments = (0, False, Point(*place), self._vehicle.heading(), seconds(_HOLD_DURATION))
        self._vehicle.call("go_to", srv.GoTo, *arguments).add_done_callback(self._note_hold)

    @override
    def release(self) -> None:
        self._held_at = None

    def _note_hold(self, answer):
        if answer.exception() is not None:
            self._connection.handle.warn(f"{self.name}: it cannot be held: {answer.exception()}")
