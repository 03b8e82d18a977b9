"""Rejection of poses that the vehicle cannot have flown to, and detection of tilt."""

import math
from collections.abc import Sequence
from enum import Enum

#: A position that is too far away is accepted after the vehicle has been measured there for this
#: time (s): it was carried there while it was not measured. Not in flight, see `MIN_RESPONSE`.
PERSISTENCE = 0.3

#: In flight, poses at a position that is too far away are accepted once the control has led the
#: vehicle this far from where it was at the first of them, m, and their own displacement differs
#: from that by less than this fraction of it.
MIN_RESPONSE, MAX_RESPONSE_ERROR = 0.15, 0.4

#: After outliers in flight, the vehicle may differ from the acceleration of its control by this
#: much (m/s^2) for this time (s): its position is up to 0.145 m from the predicted one.
ACCELERATION_ERROR, MAX_PREDICTION_TIME = 1.0, 0.5

MAX_PREDICTION_STEP = 0.1  #: Pause between poses after which the clock may have been set (s).

#: The velocity before an outlier is the mean over up to twice the former (s); it is 0 if that is
#: shorter than the latter.
VELOCITY_WINDOW, MIN_VELOCITY_WINDOW = 0.1, 0.02

#: Longest time for which a vehicle that was not measured is assumed to have flown on (s).
MAX_COAST_TIME = 0.5

#: Number of poses in a row, without a jump between them, that are accepted after outliers: some
#: outliers happen to lie where the vehicle might be.
CONFIRMATION = 3

#: A single pose is accepted within this time after a good one (s): the vehicle cannot be far.
TRUST_WINDOW = 0.03
NOISE_MARGIN = 0.02  #: Largest displacement of a pose by noise (m).
Pose = tuple[float, tuple[float, ...]]  #: Time (s) and position (m).


class Classification(Enum):
    """Classification of a pose."""

    GOOD = "good"
    BAD = "bad"
    MOVED = "moved"  #: Good, but the vehicle was moved without flying: filters restart.


class _Prediction:
    """Predicted position of a vehicle with the acceleration of its control."""

    def __init__(self, pose: Pose, velocity: Sequence[float]):
        self.begin, self.position = pose
        self._time = self.begin
        self._velocity = velocity

    def advance(self, time: float, acceleration: Sequence[float]) -> None:
        """Advance to ``time`` (s) with an acceleration, m/s^2."""
        dt, self._time = min(time - self._time, MAX_PREDICTION_STEP), time
        self.position = tuple(
            x + dt * (v + 0.5 * dt * a)
            for x, v, a in zip(self.position, self._velocity, acceleration, strict=True)
        )
        self._velocity = [v + dt * a for v, a in zip(self._velocity, acceleration, strict=True)]


class PoseGate:
    """Rejects and counts poses that a vehicle of ``max_speed`` (m/s) cannot have reached.

    In flight, poses are accepted again at the position that the control predicts from the last good
    pose, or if they move as the control demands; poses that stay at one place are not.
    """

    def __init__(self, max_speed: float):
        self.rejected = 0
        self.max_speed = max_speed
        self.reset()

    def reset(self) -> None:
        """Accept the next pose."""
        # The last accepted pose, the last one received, and since when and for how many poses
        # the latter have had no jump.
        self._last: Pose | None = None
        self._previous: Pose | None = None
        self._since = 0.0
        self._count = 0
        # Two accepted poses, `VELOCITY_WINDOW` or more apart: the older one begins a velocity.
        self._older: Pose = (0.0, (0.0, 0.0, 0.0))
        self._newer: Pose = self._older
        self._prediction: _Prediction | None = None  # Since the last good pose.
        # First pose at the present place, and where the prediction was then.
        self._first: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def classify(
        self, time: float, position: Sequence[float], acceleration: Sequence[float] | None = None
    ) -> Classification:
        """Classify a pose by its position (m) and stamp (s); an earlier one resets the gate.

        ``acceleration`` is that of the control (m/s^2, fixed frame); None while it is not known, or
        the thrust is not that of flight.
        """
        pose = (time, tuple(position))
        last = self._last
        if last is None or time < last[0]:
            self.reset()
            self._older = self._newer = pose
            return self._accept(pose, Classification.GOOD)
        # Nearly all poses follow a good one, and are good.
        if self._previous is last and self._is_reachable(last, pose):
            return self._accept(pose, Classification.GOOD)
        if self._previous is None or not self._is_reachable(self._previous, pose):
            self._since = time
            self._count = 0
            self._first = None
        self._previous = pose
        self._count += 1
        is_recent = time - last[0] < TRUST_WINDOW
        if is_recent and self._is_reachable(last, pose):
            return self._accept(pose, Classification.GOOD)
        leads_here = responds = True
        if acceleration is not None:
            leads_here, responds = self._compare_with_control(last, pose, acceleration)
        is_steady = leads_here and self._count >= CONFIRMATION
        if is_steady and self._is_reachable(last, pose):
            return self._accept(pose, Classification.GOOD)
        if responds and time - self._since >= PERSISTENCE - 1e-6:
            self._older = self._newer = pose
            return self._accept(pose, Classification.MOVED)
        self.rejected += 1
        return Classification.BAD

    def _compare_with_control(self, last, pose, acceleration):
        """Return whether the control leads to a pose, and whether poses move as it demands."""
        time, position = pose
        if self._prediction is None:
            self._prediction = _Prediction(last, self._velocity(last))
        prediction = self._prediction
        prediction.advance(time, acceleration)
        if self._first is None:
            self._first = position, prediction.position
        elapsed = min(time - prediction.begin, MAX_PREDICTION_TIME)
        margin = NOISE_MARGIN + 0.5 * ACCELERATION_ERROR * elapsed**2
        leads_here = math.dist(position, prediction.position) < margin
        moved, led = (
            [b - a for a, b in zip(first, now, strict=True)]
            for first, now in zip(self._first, (position, prediction.position), strict=True)
        )
        way = math.hypot(*led)
        responds = way > MIN_RESPONSE and math.dist(moved, led) < MAX_RESPONSE_ERROR * way
        return leads_here, responds

    def _velocity(self, last):
        (begin, start), (end, position) = self._older, last
        duration = end - begin
        if duration < MIN_VELOCITY_WINDOW:
            return [0.0] * len(start)
        return [(b - a) / duration for a, b in zip(start, position, strict=True)]

    def _accept(self, pose, classification):
        self._last = self._previous = pose
        self._prediction = None
        if pose[0] - self._newer[0] > VELOCITY_WINDOW:
            self._older, self._newer = self._newer, pose
        return classification

    def _is_reachable(self, start, end):
        way = self.max_speed * min(end[0] - start[0], MAX_COAST_TIME) + NOISE_MARGIN
        return math.dist(start[1], end[1]) <= way


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
