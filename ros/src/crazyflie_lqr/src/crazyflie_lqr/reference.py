"""Guards the reference and measures the age of states."""

import math
from collections.abc import Callable, Sequence

from crazyflie_lqr.linear_feedback import Components, at_rest
from crazyflie_model.limits import HOLD_LIMIT
from crazyflie_utils.timers import CLOCK_STEP

#: Age of the last reference up to which its velocity is used (s).
VELOCITY_LIMIT = 0.5
MAX_LEAD = 0.5  #: Largest integral of the velocities beyond the motion of the points (m).
_MEMORY = 2.0  #: Time constant at which such a lead is forgotten (s).
#: Distance of a point from the extrapolated one above which the reference has jumped (m).
_JUMP = 0.1
_FASTEST = 100.0  #: Limit of velocities, against overflow (m/s).

_HERE = (0.0, 0.0, 0.0)

Vector = Sequence[float]  #: Three components, fixed frame.


class VelocityCheck:
    """Compares the velocity of a sequence of references with the motion of their points.

    A controller adds gain times velocity to gain times position: where the point of references
    stays while they have a velocity, the vehicle comes to rest away from it, by velocity gain over
    position gain times that velocity. The check compares the integral of the velocity with
    the motion of the points. The difference does not grow if both agree, at any message rate.
    """

    def __init__(self) -> None:
        self._last: tuple[Vector, Vector, float] | None = None
        self._lead: Vector = _HERE

    def update(self, position: Vector, velocity: Vector, time: float) -> bool:
        """Process a reference (m, m/s) at ``time`` (s); return whether its velocity is used."""
        velocity = limited(velocity, _FASTEST)
        if self._last is not None and time >= self._last[2]:
            self._advance(*self._last, position, time)
        else:
            self._lead = _HERE
        self._last = position, velocity, time
        ahead = sum(a * b for a, b in zip(self._lead, velocity, strict=True))
        return ahead <= MAX_LEAD * math.hypot(*velocity)

    def _advance(self, last_position, last_velocity, last_time, position, time):
        elapsed = time - last_time
        dt = min(elapsed, VELOCITY_LIMIT)
        led = [dt * part for part in last_velocity]
        moved: Vector = [b - a for a, b in zip(last_position, position, strict=True)]
        if math.dist(moved, led) > _JUMP + math.hypot(*led):
            moved = _HERE
        keep = math.exp(-elapsed / _MEMORY)
        lead = [keep * a + b - c for a, b, c in zip(self._lead, led, moved, strict=True)]
        # Bounded, so that correct velocities are soon used again.
        self._lead = limited(lead, 2.0 * MAX_LEAD)


def limited(vector: Vector, size: float) -> list[float]:
    """Return a vector, made shorter if it is longer than ``size``; 0 if its length overflows."""
    length = math.hypot(*vector)
    scale = size / length if length > size else 1.0
    return [scale * part for part in vector]


DESCENT_LIMIT = 0.3  #: Time for which a descent's reference overrides all others (s).


class GuardedReference:
    """Last valid reference; after invalid ones, the place where the vehicle is.

    `crazyflie_model.limits.HOLD_LIMIT` after the first invalid reference the vehicle stops
    where it is, until a valid one comes. A reference that is older than the present one is ignored.
    One that is further from the vehicle than ``max_jump`` (m) is replaced by a position at rest at
    this distance in the same direction, which stays while references come from about the same
    place, and which is no further than ``max_jump`` from the last reference that was not replaced
    either: near references of one source do not lead the vehicle step by step to the distant one
    of another. A velocity is limited to ``max_speed`` (m/s). ``report(text)`` is called in both
    cases. A reference with a velocity becomes a position at rest when no other has followed for
    `VELOCITY_LIMIT`, and at once when the positions of the references do not move with their
    velocities (see `VelocityCheck`). ``yaw_index`` is the index of the yaw in the state.
    """

    def __init__(
        self,
        yaw_index: int,
        max_jump: float = math.inf,
        report: Callable[[str], None] = lambda text: None,
        max_speed: float = math.inf,
    ):
        self.max_jump = max_jump
        self.max_speed = max_speed
        self._yaw_index = yaw_index
        self._report = report
        # What is followed; where that is a position at rest instead of a reference, it stays.
        self._goal: Components | None = None
        self._is_new = self._holds = False
        self._expiry = math.inf  # When invalid references end the goal (s).
        # The last reference that was followed, and that which was not, with what is instead of it.
        self._accepted: Components | None = None
        self._far: Components | None = None
        self._near: Components = ()
        self._velocity_check = VelocityCheck()
        self._time = self._stamp = 0.0
        self._descent: Components | None = None
        self._descent_time = 0.0

    def update(
        self, x_ref: Components, stamp: float = 0.0, now: float = 0.0, time: float = 0.0
    ) -> bool:
        """Accept a valid reference; return False if it is older than the present one, and ignored.

        It was made at ``stamp`` (s; 0 if that is not known); ``now`` is by the same clock, and
        limits the stamp; ``time`` is now, s, by the clock of `value`.
        """
        # After a reset of the clock, earlier stamps cannot be compared.
        if self._stamp > now:
            self._stamp = 0.0
        if 0.0 < stamp < self._stamp:
            return False
        if stamp > 0.0:
            self._stamp = min(stamp, now)
        self._goal, self._time, self._expiry = self._with_velocity(x_ref, time), time, math.inf
        self._is_new, self._holds = True, False
        return True

    def invalidate(self, time: float) -> None:
        """Record that an invalid reference came at ``time`` (s)."""
        if not self._holds:
            self._expiry = min(self._expiry, time + HOLD_LIMIT)

    def descend(self, x_ref: Components, time: float) -> None:
        """Set the reference of a descent, x_dim components, at ``time`` (s)."""
        self._descent = x_ref
        self._descent_time = time

    def value(self, time: float, x: Components) -> Components | None:
        """Return the reference to follow, x_dim components, at ``time`` (s) and the state ``x``.

        None before the first valid reference.
        """
        if self._descent is not None and 0.0 <= time - self._descent_time < DESCENT_LIMIT:
            return self._descent
        if self._goal is None:
            return None
        if time >= self._expiry:
            self._goal, self._expiry = at_rest(x, self._yaw_index), math.inf
            self._is_new, self._holds = False, True
        if self._is_new:
            self._is_new = False
            self._goal = self._within_reach(self._goal, x)
        if any(self._goal[3:6]) and not 0.0 <= time - self._time < VELOCITY_LIMIT:
            self._goal = at_rest(self._goal, self._yaw_index)
            # A landing ends a stream of references as it should.
            if self._descent is None or self._descent_time < self._time:
                self._report(
                    f"the reference has a velocity and none has followed for {VELOCITY_LIMIT:g} "
                    "s; stopping at its position"
                )
        return self._goal

    def _with_velocity(self, x_ref, time):
        """Return a reference with the velocity that is used."""
        velocity = x_ref[3:6]
        if not self._velocity_check.update(x_ref[:3], velocity, time):
            self._report(
                "the velocity of the references is ignored, since they do not move with it"
            )
            return at_rest(x_ref, self._yaw_index)
        speed = math.hypot(*velocity)
        if speed <= self.max_speed:
            return x_ref
        self._report(
            f"the reference has a velocity of {speed:.1f} m/s; expected <= {self.max_speed:g} m/s, "
            "the velocity is limited"
        )
        return [*x_ref[:3], *limited(velocity, self.max_speed), *x_ref[6:]]

    def _within_reach(self, x_ref, x):
        distance = math.dist(x_ref[:3], x[:3])
        if distance <= self.max_jump:
            self._accepted, self._far = x_ref, None
            return x_ref
        self._report(
            f"the reference is {distance:.1f} m away; flying {self.max_jump:g} m in its direction"
        )
        # A distant reference that is repeated must not lead the vehicle there step by step.
        if self._far is None or math.dist(x_ref[:3], self._far[:3]) >= self.max_jump:
            self._far = x_ref
            self._near = at_rest(x_ref, self._yaw_index)
            goal, last = x_ref[:3], self._accepted
            # A vehicle that is far from there has been carried since.
            if last is not None and math.dist(last[:3], x[:3]) <= 2.0 * self.max_jump:
                goal = _towards(goal, last[:3], self.max_jump)
            self._near[:3] = _towards(goal, x[:3], self.max_jump)
        return self._near


def _towards(goal, start, longest):
    """Return a point in the direction of a goal, at most ``longest`` (m) from the start."""
    distance = math.dist(goal, start)
    if distance <= longest:
        return goal
    # A weighted mean, which does not overflow for far references or short distances.
    share = longest / distance
    return [(1.0 - share) * a + share * b for a, b in zip(start, goal, strict=True)]


#: Difference above which two clocks are unrelated (s): one of them is simulated, or is that of a
#: bag.
SAME_CLOCK = 60.0

_DRIFT = 1e-3  #: Largest relative drift of unrelated clocks (s/s).


class StateAge:
    """Estimates the age of states, also if their stamps are of another clock.

    A stamp that is within `SAME_CLOCK` of now is of this machine's clock, and so are all later
    ones: a stamp of minutes ago is then old. Before that, the smallest difference between now
    and a stamp is the offset of the other clock, and the age is the rest. The measurement
    restarts if stamps of another clock repeat or go back, and if this machine's clock was set.
    """

    def __init__(self) -> None:
        self._offset = math.inf  # Infinite if it is not known; 0 for this machine's clock.
        self._stamp = self._time = self._wall_offset = 0.0

    def update(self, stamp: float, now: float, time: float) -> float:
        """Return the age, s, of a state with a stamp (s; 0: no stamp); negative in the future.

        ``stamp`` and ``now`` are wall-clock time (s), ``time`` is the same moment by a clock that
        is never set (s).
        """
        if stamp == 0.0:
            return 0.0
        difference, elapsed = now - stamp, time - self._time
        # Simulated time was reset, or the wall clock was set.
        if elapsed < 0.0 or abs(now - time - self._wall_offset) > CLOCK_STEP:
            self._offset = math.inf
        if abs(difference) <= SAME_CLOCK:
            self._offset = 0.0
        elif self._offset != 0.0:
            usual = math.inf if stamp <= self._stamp else self._offset + _DRIFT * elapsed
            self._offset = min(usual, difference)
        self._stamp, self._time, self._wall_offset = stamp, time, now - time
        return difference - self._offset
