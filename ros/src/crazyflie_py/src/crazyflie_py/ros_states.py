"""The state of a vehicle, from its poses."""

import math
from collections.abc import Callable

from crazyflie_mission_api.mission_vehicle import Clock
from crazyflie_mission_api.ros_vehicle import Pose, RosVehicle, velocity_between
from crazyflie_model.angles import Triple, rpy_from_quaternion
from crazyflie_py.backend import VehicleState

_STATE_TIMEOUT = 10.0  #: For a pose, s of the vehicles' time.
_VELOCITY_SPAN = 0.2  #: Longest time between two poses from which a velocity follows, s.

_UNKNOWN: Triple = (math.nan, math.nan, math.nan)


class RosStates:
    """States of one vehicle; accelerations are not known, NaN."""

    def __init__(self, vehicle: RosVehicle, clock: Clock):
        self._vehicle = vehicle
        self._clock = clock
        self._last: Pose | None = None
        self._velocity = _UNKNOWN

    def state(self) -> VehicleState:
        """Return the state; its velocity is that between two poses.

        Raises
        ------
        TimeoutError
            No pose has come for 10 s.
        """
        pose, last = self._wait(lambda pose: True), self._last
        if last is None or pose.time - last.time > _VELOCITY_SPAN:
            last, pose = pose, self._wait(lambda new: new.time > pose.time)
        if pose.time > last.time:
            self._velocity = velocity_between(last, pose)
        self._last = pose
        rpy = rpy_from_quaternion(*pose.rotation)
        return VehicleState(pose.position, self._velocity, _UNKNOWN, rpy)

    def _wait(self, condition: Callable[[Pose], bool]) -> Pose:
        def is_there():
            pose = self._vehicle.pose()
            return pose is not None and condition(pose)

        self._clock.wait_until(is_there, self._clock.time() + _STATE_TIMEOUT)
        pose = self._vehicle.pose()
        if pose is None:
            raise TimeoutError(
                f"{self._vehicle.name}: no position for {_STATE_TIMEOUT:g} s; does motion capture "
                "track it?"
            )
        return pose
