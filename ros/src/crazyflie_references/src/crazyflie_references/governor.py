"""The reference that a controller follows, whatever references come."""

import math
from collections.abc import Callable, Sequence

from crazyflie_model.limits import HOLD_LIMIT
from crazyflie_references.velocity_check import VELOCITY_LIMIT, Vector, VelocityCheck, limited

#: A state or a reference; for so few numbers, plain floats are several times faster than arrays.
Components = Sequence[float]

DESCENT_LIMIT = 0.3  #: Time for which a descent's reference overrides all others (s).
RIVAL_TIME = 5.0  #: Time for which a reference of another publisher prevents long ways (s).
TRAVEL_SPEED = 1.0  #: Largest speed on the way to a distant reference (m/s).
_ACCELERATION = 0.5  #: Acceleration and braking on this way (m/s^2).
#: Distance at which the point on the way waits for the vehicle, and slows down from half of it (m).
_LEAD = 1.0
_LONGEST_STEP = 0.1  #: Longest time between two states for which it moves (s).


def at_rest(x: Components, yaw_index: int) -> list[float]:
    """Return the reference, x_dim components, that stays at the place and heading of a state."""
    x_ref = [*x[:3], *[0.0] * (len(x) - 3)]
    x_ref[yaw_index] = x[yaw_index]
    return x_ref


class Travel:
    """The way to a distant goal: a point that begins at the vehicle, which it never leaves behind.

    It moves straight towards the goal, with at most ``speed`` (m/s); the goal may change.
    """

    def __init__(self, speed: float):
        self._goal: Vector = ()  # Place of the last goal.
        self._largest = speed

    def restart(self, position: Vector, time: float) -> None:
        """Begin at rest at a position (m) at ``time`` (s)."""
        self._position = list(position)
        self._time = time
        self._speed = 0.0

    def is_towards(self, goal: Components) -> bool:
        """Return whether the goal is where the last one was."""
        return len(self._goal) > 0 and math.dist(goal[:3], self._goal) == 0.0

    def advance(self, time: float, x: Components, goal: Components) -> Components:
        """Advance to ``time`` (s); return the reference, or the goal when it is reached."""
        dt = min(max(time - self._time, 0.0), _LONGEST_STEP)
        self._time, self._goal = time, goal[:3]
        way = [b - a for a, b in zip(self._position, goal[:3], strict=True)]
        left = math.hypot(*way)
        lag = math.dist(self._position, x[:3])
        largest = self._largest * min(max(2.0 * (1.0 - lag / _LEAD), 0.0), 1.0)
        braking = math.sqrt(2.0 * _ACCELERATION * left)
        self._speed = min(self._speed + _ACCELERATION * dt, largest, braking)
        if left <= max(self._speed * dt, 1e-3):
            return goal
        velocity = [self._speed * part / left for part in way]
        self._position = [a + dt * v for a, v in zip(self._position, velocity, strict=True)]
        return [*self._position, *velocity, *goal[6:]]


class ReferenceGovernor:
    """Last valid reference; after invalid ones, the place where the vehicle is.

    `crazyflie_model.limits.HOLD_LIMIT` after the first invalid reference the vehicle stops
    where it is, until a valid one comes. A reference that is older than the present one is ignored.

    One that is further from the vehicle than ``max_jump`` (m) is travelled to, see `Travel`. But
    while another publisher sends references, too, it is replaced by a position at rest at this
    distance in its direction, which stays while references come from about the same place, and
    which is no further than ``max_jump`` from the last reference that was near: near references of
    one publisher do not lead the vehicle step by step to the distant one of another.

    A velocity is limited to ``max_speed`` (m/s). A reference with a velocity becomes a position at
    rest when no other has followed for `VELOCITY_LIMIT`, and at once when the positions of the
    references do not move with their velocities (see `VelocityCheck`). ``report(kind, text)`` is
    called when a reference is not followed as it is. ``yaw_index`` is the index of the yaw in the
    state.
    """

    def __init__(
        self,
        yaw_index: int,
        max_jump: float = math.inf,
        report: Callable[[str, str], None] = lambda kind, text: None,
        max_speed: float = math.inf,
    ):
        self.max_jump = max_jump
        self.max_speed = max_speed
        self._yaw_index = yaw_index
        self._report = report
        self._goal: Components | None = None  # What is followed.
        self._is_new = self._holds = False
        self._expiry = math.inf  # When invalid references end the goal (s).
        self._source: str | None = None  # Publisher of the last reference.
        self._rival_time = -math.inf  # When another one published last (s).
        self._accepted: Components | None = None  # The last reference that was near.
        self._travel: Travel | None = None  # While the goal is distant.
        # The last distant reference of one of several publishers, and what is in its place.
        self._far: Components | None = None
        self._near: Components = ()
        self._velocity_check = VelocityCheck()
        self._time = self._stamp = 0.0
        self._descent: Components | None = None
        self._descent_time = 0.0

    def update(
        self,
        x_ref: Components,
        stamp: float = 0.0,
        now: float = 0.0,
        time: float = 0.0,
        source: str = "",
    ) -> bool:
        """Accept a valid reference; return False if it is older than the present one, and ignored.

        It was made at ``stamp`` (s; 0 if that is not known); ``now`` is by the same clock, and
        limits the stamp; ``time`` is now, s, by the clock of `value`. ``source`` is its publisher.
        """
        # After a reset of the clock, earlier stamps cannot be compared.
        if self._stamp > now:
            self._stamp = 0.0
        if 0.0 < stamp < self._stamp:
            return False
        if stamp > 0.0:
            self._stamp = min(stamp, now)
        if source != self._source:
            if self._source is not None:
                self._rival_time = self._time
            self._source = source
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

    def stay(self, x: Components) -> None:
        """Keep the place and heading of a state until a reference comes."""
        self._goal, self._expiry = at_rest(x, self._yaw_index), math.inf
        self._is_new, self._holds, self._travel = False, True, None

    def value(self, time: float, x: Components) -> Components | None:
        """Return the reference to follow, x_dim components, at ``time`` (s) and the state ``x``.

        None before the first valid reference.
        """
        if self._descent is not None and 0.0 <= time - self._descent_time < DESCENT_LIMIT:
            return self._descent
        if self._goal is None:
            return None
        if time >= self._expiry:
            self.stay(x)
        if self._is_new:
            self._is_new = False
            self._begin(self._goal, time, x)
        if self._travel is not None:
            if self._has_rival(time):
                # Afterwards the way begins at the vehicle.
                self._travel.restart(x[:3], time)
                return self._near
            x_ref = self._travel.advance(time, x, self._goal)
            if x_ref is not self._goal:
                return x_ref
            self._accept(self._goal)
        if any(self._goal[3:6]) and not 0.0 <= time - self._time < VELOCITY_LIMIT:
            self._goal = at_rest(self._goal, self._yaw_index)
            # A landing ends a stream of references as it should.
            if self._descent is None or self._descent_time < self._time:
                self._report(
                    "silence",
                    f"the reference has a velocity and none has followed for {VELOCITY_LIMIT:g} "
                    "s; stopping at its position",
                )
        return self._goal

    def _with_velocity(self, x_ref, time):
        """Return a reference with the velocity that is used."""
        velocity = x_ref[3:6]
        if not self._velocity_check.update(x_ref[:3], velocity, time):
            self._report(
                "velocity",
                "the velocity of the references is ignored, since they do not move with it",
            )
            return at_rest(x_ref, self._yaw_index)
        speed = math.hypot(*velocity)
        if speed <= self.max_speed:
            return x_ref
        self._report(
            "speed",
            f"the reference has a velocity of {speed:.1f} m/s; expected <= {self.max_speed:g} m/s, "
            "the velocity is limited",
        )
        return [*x_ref[:3], *limited(velocity, self.max_speed), *x_ref[6:]]

    # Distant references.

    def _has_rival(self, time):
        return 0.0 <= time - self._rival_time < RIVAL_TIME

    def _accept(self, goal):
        self._accepted, self._far, self._travel = goal, None, None

    def _begin(self, goal, time, x):
        distance = math.dist(goal[:3], x[:3])
        is_same = self._travel is not None and self._travel.is_towards(goal)
        if distance <= self.max_jump and not is_same:
            self._accept(goal)
            return
        speed = min(TRAVEL_SPEED, self.max_speed)
        if self._has_rival(time):
            self._stop_short(goal, x)
            self._report(
                "distance",
                f"the reference is {distance:.1f} m away, and another node sends some, too; "
                f"flying {self.max_jump:g} m in its direction",
            )
        elif self._travel is None:
            self._report(
                "distance", f"the reference is {distance:.1f} m away; flying there at {speed:g} m/s"
            )
        if self._travel is None:
            self._travel = Travel(speed)
            self._travel.restart(x[:3], time)

    def _stop_short(self, distant, x):
        """Set the position at rest that takes the place of a distant goal."""
        # A distant reference that is repeated must not lead the vehicle there step by step.
        goal, far = distant[:3], self._far
        if far is not None and math.dist(goal, far[:3]) < self.max_jump:
            return
        self._far = distant
        near = at_rest(distant, self._yaw_index)
        last = self._accepted
        # A vehicle that is far from there has been carried since.
        if last is not None and math.dist(last[:3], x[:3]) <= 2.0 * self.max_jump:
            goal = _towards(goal, last[:3], self.max_jump)
        near[:3] = _towards(goal, x[:3], self.max_jump)
        self._near = near


def _towards(goal, start, longest):
    """Return a point in the direction of a goal, at most ``longest`` (m) from the start."""
    distance = math.dist(goal, start)
    if distance <= longest:
        return goal
    # A weighted mean, which does not overflow for far references or short distances.
    share = longest / distance
    return [(1.0 - share) * a + share * b for a, b in zip(start, goal, strict=True)]
