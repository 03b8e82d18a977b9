"""Whether poses still are those of the vehicle, or a camera repeats what it has seen last.

A camera that is frozen goes on sending poses with fresh stamps: the same one, or the same with
noise. The controller sees a vehicle that does not answer, and asks for more and more.

Two things do not happen to a vehicle in flight. It does not come to rest within one pose and
stay at the same place to the last bit: what is measured has noise, and what is simulated gets
slower gradually. And it does not stay at a place while its control accelerates it:

    p'' = a(u) + d,

with the acceleration a that the control commands and a disturbance d, of weight, battery and
wind, which changes slowly. A controller answers to the motion of the vehicle; so when a(u) has
changed, the vehicle has moved, or is about to.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

CLEAR = 0.01
"""So far above that place a pose that repeats is none on the ground, m: that repeats, too."""

HEAVY, LIFTING = 3.0, 0.3
"""On the ground a vehicle may need so much acceleration upwards more than nominal, m/s^2; what is
commanded beyond that lifts any, when it has made so much speed, m/s."""

_ROUNDING = 1e-6
"""A vehicle whose last motion was smaller than this, m, has come to rest gradually."""

LIFTED = 0.04
"""So far above the place where its motors were off last, a vehicle flies, m."""

BLOCK = 0.1
"""Poses and controls are averaged over so long, s."""

WINDOW = 10
"""Blocks over which poses and control are compared."""

LAG = 2
"""By so many blocks the poses that are compared are later than the control."""

STILL = 0.015
"""The averaged poses of a window that stay within this distance of their mean are still, m."""

UNANSWERED = 0.8
"""Acceleration to which no vehicle stays still, m/s^2; more as long as little is known of the
disturbance."""

UNKNOWN = 2.0
"""By how much more at the beginning, m/s^2; weight and thrust may be wrong by 20 %."""

MEMORY = 10.0
"""Time over which the disturbance is averaged, s."""

_LIFT_TIME, _LIFT_WEIGHT = 0.5, 2.0
"""At the beginning the disturbance is the opposite of the acceleration at which the vehicle lifts
off, averaged over the former, s; that stands for the latter of `MEMORY`, s."""

_SUPPORTED = -0.5
"""With less acceleration upwards than this, m/s^2, something may carry the vehicle."""

_LEFT = 0.03
"""A camera that has gone on shows the vehicle further away than this, m, ..."""

_CONFIRMATION = 3
"""... in so many poses in a row."""

Vector = Sequence[float]


class _Block(NamedTuple):
    time: float
    position: Vector
    acceleration: Vector


class FrozenPoseMonitor:
    """Tells whether the poses of a vehicle have stopped being its own.

    Parameters
    ----------
    knows_control : bool
        Whether the acceleration that the control commands is known. If it is not, only poses
        that repeat to the last bit can be told, above the lowest one that was seen.
    """

    def __init__(self, knows_control: bool):
        self._knows_control = knows_control
        self.reset()

    def reset(self) -> None:
        """Begin anew: the next pose is the vehicle's."""
        self._ground: float | None = None
        self._lift: float | None = None
        self._stood_at = 0.0
        self.restart()

    def restart(self) -> None:
        """Take note that the vehicle is elsewhere, and did not fly there."""
        self._last: tuple[Vector, Vector] | None = None
        self._last_step = 0.0
        self._repeats = False
        self._lifting = 0.0
        self._time = 0.0
        self._place: Vector | None = None
        self._outside = 0
        self._forget()

    def _forget(self):
        self._samples: list[tuple[Vector, Vector]] = []
        self._begin: float | None = None
        self._window: deque[_Block] = deque()
        self._disturbance = Disturbance()
        if self._lift is not None:
            self._disturbance.start((0.0, 0.0, -self._lift), _LIFT_WEIGHT)

    def update(
        self, time: float, position: Vector, rotation: Vector, acceleration: Vector | None
    ) -> bool:
        """Take a pose; return whether it is not the vehicle's.

        Parameters
        ----------
        time : float
            Its stamp, s, later than the one before.
        position : sequence, 3 components
            m, fixed frame.
        rotation : sequence, 4 components
            Quaternion.
        acceleration : sequence, 3 components, or None
            That the control commands, m/s^2, fixed frame; None while the control is unknown or
            not that of flight.
        """
        if self._ground is None or (self._knows_control and acceleration is None):
            self._ground = position[2]
        elif not self._knows_control:
            self._ground = min(self._ground, position[2])
        height = position[2] - self._ground
        is_repeated = self._is_repeated(time, position, rotation, acceleration, height)
        if self._place is not None:
            return self._is_still_frozen(position, self._place)
        if height > LIFTED and acceleration is not None:
            self._collect(time, position, acceleration)
        else:
            self._stand(time, acceleration)
        return is_repeated or self._place is not None

    def _stand(self, time, acceleration):
        """Take note of what is commanded on the ground, until the vehicle lifts off."""
        if acceleration is None:
            self._lift = None
        elif self._lift is None:
            self._lift = acceleration[2]
        else:
            share = min(max(time - self._stood_at, 0.0) / _LIFT_TIME, 1.0)
            self._lift += share * (acceleration[2] - self._lift)
        self._stood_at = time
        self._forget()

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
        # What repeats goes on to when the flight has ended.
        return self._repeats

    def _is_still_frozen(self, position, place):
        is_outside = math.dist(position, place) > _LEFT
        self._outside = self._outside + 1 if is_outside else 0
        if self._outside < _CONFIRMATION:
            return True
        self._place, self._outside = None, 0
        self._forget()
        return False

    def _collect(self, time, position, acceleration):
        if self._begin is None or time - self._begin >= 2.0 * BLOCK:
            self._forget()
            self._begin = time
        elif time - self._begin >= BLOCK:
            positions, accelerations = zip(*self._samples, strict=True)
            self._compare(_Block(self._begin, _mean(positions), _mean(accelerations)))
            self._begin, self._samples = time, []
        self._samples.append((position, acceleration))

    def _compare(self, block):
        self._window.append(block)
        if len(self._window) <= LAG + WINDOW:
            return
        # What is known of the disturbance is of the time before the window.
        self._disturbance.learn(self._window.popleft(), self._window[0])
        unanswered = self._unanswered()
        if unanswered is not None and math.hypot(*unanswered) > self._tolerance():
            self._place = self._window[-1].position

    def _unanswered(self):
        """Return the acceleration (3,), m/s^2, that still poses do not answer to."""
        window = list(self._window)
        seen = [each.position for each in window[LAG:]]
        middle = _mean(seen)
        if any(math.dist(each, middle) > STILL for each in seen):
            return None
        commanded = _mean([each.acceleration for each in window[:WINDOW]])
        unanswered = [a + d for a, d in zip(commanded, self._disturbance.value, strict=True)]
        return unanswered if unanswered[2] > _SUPPORTED else None

    def _tolerance(self):
        return UNANSWERED + UNKNOWN / (1.0 + self._disturbance.duration)


class Disturbance:
    """What accelerates the vehicle beside its control, averaged over `MEMORY`.

    Attributes
    ----------
    value : sequence, 3 components
        m/s^2, fixed frame.
    duration : float
        Time over which it is averaged, s.
    """

    def __init__(self) -> None:
        self.value: Vector = (0.0, 0.0, 0.0)
        self.duration = 0.0
        self._velocity: Vector | None = None

    def start(self, value: Vector, duration: float) -> None:
        """Begin with what is known otherwise, as if it was averaged over ``duration`` (s)."""
        self.value, self.duration = value, duration

    def learn(self, block: _Block, following: _Block) -> None:
        """Take note of a block and the one after it."""
        dt = following.time - block.time
        velocity = [(b - a) / dt for a, b in zip(block.position, following.position, strict=True)]
        before, self._velocity = self._velocity, velocity
        if before is None:
            return
        self.duration = min(self.duration + dt, MEMORY)
        share = dt / self.duration
        self.value = [
            d + share * ((after - start) / dt - a - d)
            for d, start, after, a in zip(
                self.value, before, velocity, block.acceleration, strict=True
            )
        ]


def _mean(vectors: Sequence[Vector]) -> list[float]:
    return [sum(column) / len(vectors) for column in zip(*vectors, strict=True)]
