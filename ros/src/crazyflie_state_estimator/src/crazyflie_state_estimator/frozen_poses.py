"""Whether poses are those of the vehicle, or a frozen camera sends its last one with new stamps.

A vehicle in flight does not come to rest within one pose and stay there to the last bit: measured
poses have noise, and simulated vehicles get slower gradually. And it does not stay at a place, to
within the noise, while its control accelerates it; see `control_response`.
"""

import math

from crazyflie_state_estimator.control_response import Departure, ResponseMonitor, Vector

#: Height above the lowest pose at which repeated poses show a frozen camera (m): poses of a vehicle
#: on the ground repeat, too.
CLEAR = 0.01

#: Largest acceleration above nominal that a vehicle may need to leave the ground (m/s^2), and the
#: speed from the acceleration beyond that with which every vehicle has left it (m/s).
HEAVY, LIFTING = 3.0, 0.3

#: Last motion of a vehicle that has come to rest gradually (m): a smaller one.
_ROUNDING = 1e-6
LIFTED = 0.04  #: Height of a flying vehicle above the place where its motors were off last (m).
_LEFT = 0.03  #: Least distance of the poses that show that the camera runs again (m).
_CONFIRMATION = 3  #: Number of such poses in a row.


class FrozenPoseMonitor:
    """Detects poses that have stopped being those of the vehicle.

    Where the acceleration that the control commands is not known, only poses that repeat to the
    last bit are detected, above the lowest one that was seen.
    """

    def __init__(self, knows_control: bool):
        self._knows_control = knows_control
        self._response = ResponseMonitor()
        self.reset()

    def reset(self) -> None:
        """Restart: the next pose is the vehicle's."""
        self._ground: float | None = None
        self._is_flying = False
        self.restart()

    def restart(self) -> None:
        """Restart after the vehicle was moved without flying."""
        self._last: tuple[Vector, Vector] | None = None
        self._last_step = 0.0
        self._repeats = False
        self._lifting = 0.0
        self._time = 0.0
        self._place: Vector | None = None
        self._outside = 0
        #: Where the vehicle is instead of the last pose, if that is the first one that does not
        #: respond to the control.
        self.departure: Departure | None = None
        self._response.reset()

    def update(
        self, time: float, position: Vector, rotation: Vector, acceleration: Vector | None
    ) -> bool:
        """Process a pose; return whether it is not the vehicle's.

        Its stamp ``time`` (s) is later than the one before; position (m, fixed frame) and rotation
        (quaternion). ``acceleration`` is the control's, m/s^2, fixed frame; None while it is
        unknown or not that of flight.
        """
        self.departure = None
        if self._ground is None or (self._knows_control and acceleration is None):
            self._ground = position[2]
        elif not self._knows_control:
            self._ground = min(self._ground, position[2])
        height = position[2] - self._ground
        is_repeated = self._is_repeated(time, position, rotation, acceleration, height)
        if self._place is not None:
            return self._is_still_frozen(position, self._place)
        if is_repeated:
            return True
        return self._has_departed(time, position, acceleration, height)

    def _has_departed(self, time, position, acceleration, height):
        self._is_flying = acceleration is not None and (self._is_flying or height > LIFTED)
        if not self._is_flying:
            self._response.reset()
            return False
        departure = self._response.update(time, position, acceleration)
        # Lower than that, the ground may carry the vehicle.
        if departure is None or height <= LIFTED:
            return False
        self.departure, self._place = departure, position
        return True

    def _is_repeated(self, time, position, rotation, acceleration, height):
        pose, last = (tuple(position), tuple(rotation)), self._last
        elapsed, self._time = time - self._time, time
        if pose != last:
            self._repeats, self._lifting = False, 0.0
            self._last_step = 0.0 if last is None else math.dist(pose[0], last[0])
            self._last = pose
            return False
        if height > CLEAR:
            self._repeats = self._repeats or self._last_step > _ROUNDING
        elif acceleration is not None and acceleration[2] > HEAVY:
            self._lifting += (acceleration[2] - HEAVY) * elapsed
            self._repeats = self._repeats or self._lifting > LIFTING
        # A pose that repeats still does so after the end of the flight.
        return self._repeats

    def _is_still_frozen(self, position, place):
        is_outside = math.dist(position, place) > _LEFT
        self._outside = self._outside + 1 if is_outside else 0
        if self._outside < _CONFIRMATION:
            return True
        self._place, self._outside = None, 0
        self._response.reset()
        return False
