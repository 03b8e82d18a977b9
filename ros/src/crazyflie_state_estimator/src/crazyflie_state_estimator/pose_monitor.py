"""Which poses are those of the vehicle: it can have flown there, it moves, it follows its control.

A vehicle in flight does not come to rest within one pose and stay there to the last bit: measured
poses have noise, and simulated vehicles get slower gradually. A frozen camera sends its last pose
with new stamps; one with noise is found by the control, see `control_response`.
"""

import math
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from crazyflie_state_estimator.control_response import Departure, ResponseMonitor


class Verdict(Enum):
    """Whether a pose can be used, and why not."""

    GOOD = "good"
    MOVED = "moved"  #: Good, but the vehicle was moved without flying: filters restart.
    REPEATED = "repeated"
    IMPOSSIBLE = "impossible"
    NOT_RESPONDING = "not responding"


NOISE_MARGIN = 0.02  #: Largest displacement of a pose by noise (m).

#: Longest time for which a vehicle that was not measured is assumed to have flown on (s).
MAX_COAST_TIME = 0.5

#: Within this time after a good pose (s) a single one is accepted: the vehicle cannot be far.
TRUST_WINDOW = 0.03

#: Number of poses in a row, without a jump between them, that are accepted after outliers: some
#: outliers happen to lie where the vehicle might be.
CONFIRMATION = 3

#: A position that is too far away is accepted after the vehicle has been measured there for this
#: time (s): it was carried there while it was not measured. Not in flight, see `MIN_RESPONSE`.
PERSISTENCE = 0.3

#: In flight, poses at a position that is too far away are accepted once the control has led the
#: vehicle this far from where it was at the first of them, m, and their own displacement differs
#: from that by less than this fraction of it.
MIN_RESPONSE, MAX_RESPONSE_ERROR = 0.15, 0.4

#: After outliers in flight, the vehicle may differ from the predicted acceleration by this much
#: (m/s^2) for this time (s): its position is up to 0.145 m from the predicted one.
ACCELERATION_ERROR, MAX_PREDICTION_TIME = 1.0, 0.5

#: Height above the lowest pose at which repeated poses show a frozen camera (m): poses of a vehicle
#: on the ground repeat, too.
CLEAR = 0.01

#: Most excess acceleration any vehicle needs to lift off (m/s^2), and the speed beyond it that
#: proves that it has (m/s).
HEAVY, LIFTING = 3.0, 0.3

#: Poses that are not higher than this (m) rest on the ground. In 150 healthy takeoffs, also of
#: vehicles that hardly lift off, they have left it when the control would have lifted the heaviest
#: one by 0.7 of the second value at most (m).
RESTING, RISEN = 0.02, 0.4
LONGEST_STEP = 0.1  #: Longest time between two poses in which a control lifts a vehicle (s).

#: Steps smaller than this (m) count as rest.
_ROUNDING = 1e-6
LIFTED = 0.04  #: Height of a flying vehicle above the place where its motors were off last (m).
_LEFT = 0.03  #: Least distance of the poses that show that a camera that froze runs again (m).

Vector = Sequence[float]
Pose = tuple[float, Vector]  #: Time (s) and position (m).


class _Rise(NamedTuple):
    """Height (m) and speed (m/s) of a vehicle above the ground, which carries it."""

    height: float = 0.0
    speed: float = 0.0

    def after(self, step: float, acceleration: float) -> "_Rise":
        """Return them after ``step`` s of an acceleration (m/s^2)."""
        speed = self.speed + step * acceleration
        height = self.height + step * speed
        return _Rise(height, speed) if height > 0.0 else _Rise()


class PoseMonitor:
    """Judges and counts the poses of a vehicle that is not faster than ``max_speed`` (m/s).

    Where the acceleration that the control commands is not known, poses are rejected that are too
    far away, or that repeat to the last bit above the lowest one that was seen.
    """

    def __init__(self, max_speed: float, knows_control: bool):
        #: Numbers of rejected poses that are too far away, and of those that are frozen.
        self.impossible = self.frozen = 0
        self._max_speed = max_speed
        self._knows_control = knows_control
        self._response = ResponseMonitor()
        self.reset()

    def reset(self) -> None:
        """Reset; trust the next pose."""
        # The last accepted pose, the last one received, and since when and for how many poses
        # the latter have had no jump.
        self._last: Pose | None = None
        self._previous: Pose | None = None
        self._since = 0.0
        self._count = 0
        # First pose at the present place, and where the prediction was then.
        self._first: tuple[Vector, Vector] | None = None
        self._ground: float | None = None
        self._is_flying = False
        self.restart()

    def restart(self) -> None:
        """Restart after the vehicle was moved without flying, or the clock was set."""
        self._seen: tuple[Vector, Vector] | None = None
        self._last_step = 0.0
        self._repeats = False
        self._lifting = 0.0
        self._rise, self._least_rise = _Rise(), _Rise()
        self._time = 0.0
        self._frozen_at: Vector | None = None
        self._outside = 0
        #: Predicted motion when a pose first contradicts the control.
        self.departure: Departure | None = None
        self._response.reset()

    @property
    def disturbance(self) -> Vector | None:
        """What weight, battery and wind add to the acceleration (m/s^2); None while unknown."""
        return self._response.disturbance

    def update(
        self, time: float, position: Vector, rotation: Vector, acceleration: Vector | None
    ) -> Verdict:
        """Judge a pose by its stamp (s), position (m, fixed frame) and rotation (quaternion).

        ``acceleration`` is the control's, m/s^2, fixed frame; None while it is unknown or not that
        of flight.
        """
        self.departure = None
        verdict = self._reach(time, position, acceleration)
        if verdict is Verdict.IMPOSSIBLE:
            self.impossible += 1
            return verdict
        if verdict is Verdict.MOVED:
            self.restart()
        if self._ground is None or (self._knows_control and acceleration is None):
            self._ground = position[2]
        elif not self._knows_control:
            self._ground = min(self._ground, position[2])
        height = position[2] - self._ground
        elapsed, self._time = time - self._time, time
        stays_down = self._stays_down(elapsed, acceleration, height)
        is_repeated = self._is_repeated(elapsed, position, rotation, acceleration, height)
        if self._frozen_at is not None:
            does_not_respond = self._is_still_frozen(position, self._frozen_at)
        else:
            does_not_respond = not is_repeated and (
                self._departs(time, position, acceleration, height) or stays_down
            )
            if does_not_respond:
                self._frozen_at = position
                self.departure = self.departure or self._risen(position)
        if does_not_respond or is_repeated:
            self.frozen += 1
            return Verdict.NOT_RESPONDING if does_not_respond else Verdict.REPEATED
        return verdict

    # Poses that the vehicle can have flown to.

    def _reach(self, time, position, acceleration):
        pose, last = (time, position), self._last
        if last is None or time < last[0]:
            return self._accept(pose, Verdict.GOOD)
        # Nearly all poses follow a good one, and are good.
        if self._previous is last and self._is_reachable(last, pose):
            self._last = self._previous = pose
            return Verdict.GOOD
        if not self._is_reachable(self._previous, pose):
            self._since = time
            self._count = 0
            self._first = None
        self._previous = pose
        self._count += 1
        is_near = self._is_reachable(last, pose)
        if time - last[0] < TRUST_WINDOW:
            return self._accept(pose, Verdict.GOOD) if is_near else Verdict.IMPOSSIBLE
        leads_here = responds = True
        if acceleration is not None:
            predicted = self._response.predict(time, acceleration, last)
            elapsed = min(time - last[0], MAX_PREDICTION_TIME)
            margin = NOISE_MARGIN + 0.5 * ACCELERATION_ERROR * elapsed**2
            leads_here = math.dist(position, predicted) < margin
            responds = self._responds(position, predicted)
        if is_near and leads_here and self._count >= CONFIRMATION:
            return self._accept(pose, Verdict.GOOD)
        if responds and time - self._since >= PERSISTENCE - 1e-6:
            return self._accept(pose, Verdict.MOVED)
        return Verdict.IMPOSSIBLE

    def _accept(self, pose, verdict):
        self._last = self._previous = pose
        return verdict

    def _is_reachable(self, start, end):
        way = self._max_speed * min(end[0] - start[0], MAX_COAST_TIME) + NOISE_MARGIN
        return math.dist(start[1], end[1]) <= way

    def _responds(self, position, predicted):
        """Return whether poses after outliers move as the control demands."""
        if self._first is None:
            self._first = position, predicted
        moved, led = (
            [b - a for a, b in zip(first, now, strict=True)]
            for first, now in zip(self._first, (position, predicted), strict=True)
        )
        way = math.hypot(*led)
        return way > MIN_RESPONSE and math.dist(moved, led) < MAX_RESPONSE_ERROR * way

    # Poses that are frozen.

    def _departs(self, time, position, acceleration, height):
        self._is_flying = acceleration is not None and (self._is_flying or height > LIFTED)
        if not self._is_flying:
            self._response.reset()
            return False
        departure = self._response.update(time, position, acceleration)
        # Lower than that, the ground may carry the vehicle.
        if departure is None or height <= LIFTED:
            return False
        self.departure = departure
        return True

    def _stays_down(self, elapsed, acceleration, height):
        """Return whether poses stay on the ground although the control has lifted any vehicle."""
        if acceleration is None or height > RESTING:
            self._rise, self._least_rise = _Rise(), _Rise()
            return False
        step = min(max(elapsed, 0.0), LONGEST_STEP)
        self._rise = self._rise.after(step, acceleration[2])
        self._least_rise = self._least_rise.after(step, acceleration[2] - HEAVY)
        return self._least_rise.height > RISEN and self._least_rise.speed > LIFTING

    def _risen(self, position):
        """Return where a vehicle is whose poses have stayed on the ground."""
        x, y, z = position
        return Departure((x, y, z + self._rise.height), (0.0, 0.0, self._rise.speed))

    def _is_repeated(self, elapsed, position, rotation, acceleration, height):
        pose, last = (position, rotation), self._seen
        if pose != last:
            self._repeats, self._lifting = False, 0.0
            self._last_step = 0.0 if last is None else math.dist(position, last[0])
            self._seen = pose
            return False
        if height > CLEAR:
            self._repeats = self._repeats or self._last_step > _ROUNDING
        elif acceleration is not None and acceleration[2] > HEAVY:
            self._lifting += (acceleration[2] - HEAVY) * elapsed
            if self._lifting > LIFTING and not self._repeats:
                self._repeats, self.departure = True, self._risen(position)
        # A pose that repeats still does so after the end of the flight.
        return self._repeats

    def _is_still_frozen(self, position, place):
        self._outside = self._outside + 1 if math.dist(position, place) > _LEFT else 0
        if self._outside < CONFIRMATION:
            return True
        self._frozen_at, self._outside = None, 0
        self._response.reset()
        return False


class TiltMonitor:
    """Detects that the vehicle has tipped over by more than ``max_tilt`` (rad).

    A single pose is not enough: motion capture may mistake one marker for another.
    """

    _POSES = 5

    def __init__(self, max_tilt: float):
        # The cosine of the angle between the vehicle's z axis and that of the fixed frame.
        self._least_cosine = math.cos(max_tilt)
        self._count = 0
        self._is_tilted = False

    def update(self, x: float, y: float) -> bool:
        """Return whether the vehicle has tipped over; x, y are of the pose's unit quaternion."""
        is_tilted = 1.0 - 2.0 * (x * x + y * y) < self._least_cosine
        self._count = 0 if is_tilted == self._is_tilted else self._count + 1
        if self._count >= self._POSES:
            self._is_tilted = is_tilted
            self._count = 0
        return self._is_tilted
