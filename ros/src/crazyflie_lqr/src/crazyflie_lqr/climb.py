"""The climb of a takeoff: a height reference that rises gently, and a thrust that is learned.

After a step of the reference, the integrator of a soft height loop would collect the error of the
climb, and the vehicle overshoot. So the reference climbs as fast as a vehicle can follow, and what
differs from nominal is found by a disturbance observer (Ohnishi et al., Motion control for
advanced mechatronics, IEEE/ASME Trans. Mechatronics 1(1), 1996):

    z_ddot = thrust - u_ref + d,    d' = RATE (z_ddot - (thrust - u_ref) - d).

On the ground z_ddot is 0, so that the thrust grows until the vehicle lifts off. At the goal, the
integrator continues with the thrust that was found.
"""

import math

SPEED = 0.4  #: Speed of the reference (m/s).
ACCELERATION = 0.5  #: Acceleration of the reference (m/s^2).
#: Largest height of the reference above the vehicle (m): it waits until the vehicle lifts off.
LEAD = 0.15
RATE = 3.0  #: Bandwidth of the observer (1/s).
LEARNING_TIME = 3.0 / RATE  #: Shortest duration of a climb, also over no distance (s).
#: Largest distance (m) and speed (m/s) of a vehicle that has arrived at its goal.
ARRIVAL_DISTANCE, ARRIVAL_SPEED = 0.05, 0.1


class Climb:
    """The climb of one takeoff; ``limit`` is the largest disturbance estimated, m/s^2."""

    def __init__(self, limit: float):
        #: Upward acceleration in addition to that of thrust and nominal weight (m/s^2).
        self.disturbance = 0.0
        self.z = self.z_dot = self.z_ddot = 0.0  #: Reference, m, m/s and m/s^2.
        self.has_arrived = False  #: The vehicle is at its goal and the reference, too.
        self._limit = limit
        self._last_z_dot: float | None = None
        self._elapsed = 0.0

    def set_limit(self, limit: float) -> None:
        """Change the largest disturbance, m/s^2, and limit the present estimate."""
        self._limit = limit
        self.disturbance = _within(self.disturbance, limit)

    def advance(self, dt: float, z: float, z_dot: float, goal: float, excess: float) -> None:
        """Advance to the next state.

        The state is ``dt`` s after the last one (not used with the first), at height ``z`` (m) and
        speed ``z_dot`` (m/s); ``goal`` is the height to climb to (m), ``excess`` the thrust since
        the last state, less that of the reference control (m/s^2).
        """
        if self._last_z_dot is None:
            self.z, self.z_dot = z, z_dot
        else:
            gain = RATE * (z_dot - self._last_z_dot - (excess + self.disturbance) * dt)
            self.disturbance = _within(self.disturbance + gain, self._limit)
            self._advance_reference(dt, z, goal)
        self._last_z_dot = z_dot
        self._elapsed += dt
        is_near = abs(z - goal) < ARRIVAL_DISTANCE and abs(z_dot) < ARRIVAL_SPEED
        has_learned = self._elapsed >= LEARNING_TIME
        self.has_arrived = has_learned and self.z >= goal and (is_near or z > goal)

    def _advance_reference(self, dt, z, goal):
        if dt <= 0.0:
            return
        braking = math.sqrt(2.0 * ACCELERATION * max(goal - self.z, 0.0))
        z_dot = min(self.z_dot + ACCELERATION * dt, SPEED, braking)
        # A larger acceleration is a jump of the reference.
        self.z_ddot = _within((z_dot - self.z_dot) / dt, 2.0 * ACCELERATION)
        self.z_dot = z_dot
        self.z = min(self.z + z_dot * dt, z + LEAD)
        if goal - self.z < 1e-3:
            self.z, self.z_dot, self.z_ddot = goal, 0.0, 0.0


def _within(value, limit):
    return min(max(value, -limit), limit)


LIFTED = 0.05  #: Height of a flying vehicle above the lowest one that was measured (m).
LIFTOFF_TIMEOUT = 3.0  #: Longest time from a change of the reference's height to the liftoff (s).


class GroundGuess:
    """Estimates whether a vehicle flies: when it is `LIFTED`, or may be about to lift off."""

    def __init__(self) -> None:
        self._lowest = math.inf
        self._goal: float | None = None
        self._moved_at = -math.inf

    def is_flying(self, z: float, goal: float, time: float) -> bool:
        """Return the guess for a height and that of the reference (m) at ``time`` (s)."""
        self._lowest = min(self._lowest, z)
        # After a reset of the clock the timeout restarts.
        self._moved_at = min(self._moved_at, time)
        if self._goal is None or abs(goal - self._goal) > LIFTED:
            self._goal = goal
            self._moved_at = time
        return z > self._lowest + LIFTED or time - self._moved_at < LIFTOFF_TIMEOUT
