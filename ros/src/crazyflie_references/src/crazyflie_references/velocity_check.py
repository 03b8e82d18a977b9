"""Whether the velocities of references agree with the motion of their points."""

import math
from collections.abc import Sequence

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
