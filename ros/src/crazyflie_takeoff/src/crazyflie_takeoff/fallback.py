"""The control by which the supervisor flies the vehicle when no control comes.

The thrust is that of hover, as learned in flight, plus a correction by which z_dot follows a
target. The target returns the vehicle to the height at which the filter took over, or, in a
descent, decreases from zero. Roll and pitch keep the vehicle at its position; the yaw rate is zero.
Without a state, the velocity is integrated from the last one by z'' = thrust - hover thrust and by
the tilt, and controlled to zero horizontally. So a moving vehicle stops first, and a vehicle whose
thrust of hover is known to within `BLIND_SINK_RATE` comes down in any case.
"""

import math
from typing import NamedTuple

from crazyflie_model.angles import rotate_by_yaw
from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.motion import Motion

#: Longest step between two ticks (s): if a clock was set, or the process was stopped for
#: a while, a silence is not as long as it seems.
LONGEST_STEP = 0.05

AVERAGING = 2.0  #: Time over which the thrust of hover is averaged (s).
LAST_AVERAGING = 0.16  #: The same for the last motion: a load may just have been dropped (s).
#: The latter counts if it is smaller by more than this fraction, three times its noise with a
#: speed that is known to within 0.015 m/s.
LAST_DIFFERENCE = 0.03

#: Decrease of the target of z_dot in a descent, and from the start while no state comes (m/s^2).
SINK_RATE = 0.3
#: The same in a descent without a state. The thrust is this much below hover, which may be up to
#: `LAST_DIFFERENCE` too high. With the right one, a vehicle meets the ground at 0.85 m/s from 1 m,
#: and at 1.25 m/s from 2 m.
BLIND_SINK_RATE = 0.4
SINK_SPEED = 0.4  #: Speed of a descent while z_dot is measured (m/s).
PRESS_RATE = 4.0  #: Decrease of the thrust of a vehicle that does not sink (m/s^2 per s).
SETTLING = 0.3  #: Time constant with which z_dot follows its target (s).
MAX_CORRECTION = 0.2 * GRAVITY  #: Largest thrust above hover (m/s^2).
MAX_BRAKING = 0.4 * GRAVITY  #: Largest thrust below hover, which ends a climb (m/s^2).

POSITION_GAIN = 0.25 * GRAVITY  #: 0.25 rad/m, as in the softer gains (K_manual.txt) (1/s^2).
#: 0.3 rad/(m/s), which damps `POSITION_GAIN` critically (1/s). The softer gains have more, by which
#: noise of the velocity becomes tilt.
VELOCITY_GAIN = 0.3 * GRAVITY
MAX_DISTANCE = 0.5  #: Largest position error (m): the vehicle returns at 0.4 m/s at most.
MAX_SAFE_TILT = 0.15  #: Largest roll and pitch (rad).
STOPPING_TIME = 0.5  #: Time in which the vehicle is to stop horizontally (s).
HEIGHT_GAIN = 1.0  #: Target of z_dot over height error (1/s).
MAX_HEIGHT_SPEED = 0.3  #: Largest such target (m/s).
MAX_SUBSTITUTE = 1.25 * GRAVITY  #: Largest thrust of the filter's own (m/s^2).
RETURN_TIME = 0.2  #: Time in which the control changes over from the filter's own (s).


class SafeSetpoint(NamedTuple):
    """A control: roll and pitch in rad, yaw rate in rad/s, thrust in m/s^2."""

    roll: float
    pitch: float
    yaw_dot: float
    thrust: float

    @property
    def lift(self) -> float:
        """Vertical part of the thrust, m/s^2."""
        return self.thrust * math.cos(self.roll) * math.cos(self.pitch)

    def mixed(self, other: "SafeSetpoint", weight: float) -> "SafeSetpoint":
        """Return the mean with another setpoint, which has a weight (0 ... 1)."""
        return SafeSetpoint(*(a + weight * (b - a) for a, b in zip(self, other, strict=True)))


MOTORS_OFF = SafeSetpoint(0.0, 0.0, 0.0, 0.0)


class SafeControl:
    """Hover at a position, and descent, without a controller.

    ``hover`` is the thrust of hover, m/s^2; ``motion``, if it is known, was measured ``age`` s ago,
    and ``control`` has been flown since.
    """

    def __init__(
        self,
        hover: float,
        motion: Motion | None,
        age: float = 0.0,
        control: SafeSetpoint = MOTORS_OFF,
    ):
        self._hover, self._control = hover, control
        self._velocity = (0.0, 0.0, 0.0) if motion is None else motion.velocity
        self._yaw = 0.0 if motion is None else motion.yaw
        self._place: tuple[float, float, float] | None = None
        self._target = 0.0
        self._pressure = 0.0  # Reduction of the thrust while the vehicle does not sink (m/s^2).
        self.begin = self._seen = motion  #: Where the vehicle was at the begin; None if unknown.
        if motion is not None:
            self._reckon(age)

    @property
    def climb(self) -> float:
        """z_dot, measured or integrated, m/s."""
        return self._velocity[2]

    def advance(self, step: float, measured: Motion | None, sinks: bool) -> SafeSetpoint:
        """Return the next control, ``step`` s after the last one.

        ``measured`` is the latest motion; the same object again is not a new measurement. ``sinks``
        is whether the vehicle is to come down.
        """
        self._reckon(step)
        offset = self._offset(measured)
        if sinks or measured is None:
            lowest = -math.inf if measured is None else -SINK_SPEED
            rate = BLIND_SINK_RATE if sinks and measured is None else SINK_RATE
            self._target = max(self._target - rate * min(step, LONGEST_STEP), lowest)
        else:
            self._target = limited(HEIGHT_GAIN * offset[2], MAX_HEIGHT_SPEED)
        x, y = (
            POSITION_GAIN * limited(distance, MAX_DISTANCE) - VELOCITY_GAIN * speed
            for distance, speed in zip(offset[:2], self._velocity[:2], strict=True)
        )
        forward, left = rotate_by_yaw(x, y, -self._yaw)
        pitch = limited(math.atan(forward / GRAVITY), MAX_SAFE_TILT)
        roll = limited(-math.atan(left / GRAVITY), MAX_SAFE_TILT)
        self._press(step, sinks and measured is not None)
        correction = (self._target - self._velocity[2]) / SETTLING - self._pressure
        correction = min(max(correction, -MAX_BRAKING), MAX_CORRECTION)
        thrust = min(self._hover + correction, MAX_SUBSTITUTE)
        self._control = SafeSetpoint(roll, pitch, 0.0, thrust)
        return self._control

    def _press(self, step, sinks):
        """Reduce the thrust further while the vehicle does not sink although it is to.

        On the ground, that shows a touchdown. In the air, it corrects a thrust of hover that is too
        high; it stays while the vehicle sinks, but more slowly than it is to. A climb that is
        braked as much as it may be needs no correction.
        """
        lag = self._velocity[2] - self._target
        if sinks and 0.0 < lag <= 0.5 * SINK_SPEED:
            return
        stays = sinks and self._target < -0.5 * SINK_SPEED and 0.0 < lag < SETTLING * MAX_BRAKING
        self._pressure += PRESS_RATE * step if stays else -PRESS_RATE * step
        self._pressure = min(max(self._pressure, 0.0), MAX_BRAKING)

    def _offset(self, measured):
        """Return the vector from the vehicle to its position to keep, m; zero if not known."""
        if measured is None:
            self._place = None
            return 0.0, 0.0, 0.0
        if measured is not self._seen:
            self._seen = measured
            self._velocity, self._yaw = measured.velocity, measured.yaw
        if self._place is None:
            (x, y, z), (x_dot, y_dot, z_dot) = measured.position, measured.velocity
            self._place = (
                x + STOPPING_TIME * x_dot,
                y + STOPPING_TIME * y_dot,
                z + z_dot * braking_time(z_dot) / 2.0,
            )
        return tuple(to - at for to, at in zip(self._place, measured.position, strict=True))

    def _reckon(self, step):
        if step <= 0.0:
            return
        roll, pitch, _, thrust = self._control
        x, y = rotate_by_yaw(GRAVITY * math.tan(pitch), -GRAVITY * math.tan(roll), self._yaw)
        acceleration = (x, y, thrust - self._hover)
        self._velocity = tuple(
            v + step * a for v, a in zip(self._velocity, acceleration, strict=True)
        )


def braking_time(z_dot: float) -> float:
    """Return the time in which a vertical speed (m/s) ends, s."""
    return z_dot / MAX_BRAKING if z_dot > 0.0 else -z_dot / MAX_CORRECTION


def descent_time(motion: Motion, ground: float) -> float:
    """Return the duration of a descent to z = ``ground`` (m), s; a climb is ended first."""
    climb = max(motion.velocity[2], 0.0)
    height = motion.position[2] - ground + 0.5 * climb**2 / MAX_BRAKING
    return climb / MAX_BRAKING + max(height, 0.0) / SINK_SPEED


def limited(value: float, limit: float, centre: float = 0.0) -> float:
    """Return a value, limited to ``centre`` +- ``limit``."""
    return min(max(value, centre - limit), centre + limit)
