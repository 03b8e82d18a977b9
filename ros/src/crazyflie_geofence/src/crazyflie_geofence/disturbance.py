"""The disturbance that a vehicle meets in flight: what changes its velocity beside its controls.

It is compared with the bound D of the proof, docs/geofence_proof.md, which it widens.
"""

from collections.abc import Sequence

SPAN = 0.5  #: Time over which a disturbance is averaged (s).
_FADE = 0.9  #: Share of an old disturbance that counts after a further span.


class DisturbanceWatch:
    """Compares measured changes of the velocity with those that the controls explain.

    `widest` is the largest mean acceleration over `SPAN` that is certain along each axis, m/s^2:
    without what the errors of both velocities explain. Old ones fade, by half in 3 s.
    """

    def __init__(self) -> None:
        self.widest = [0.0, 0.0, 0.0]
        self._errors: Sequence[float] = (0.0, 0.0, 0.0)
        self._start: tuple[float, Sequence[float]] | None = None
        self._gained = [0.0] * 6

    def expect(self, errors: Sequence[float]) -> None:
        """Set the largest errors of measured velocities, m/s."""
        self._errors = errors

    def restart(self) -> None:
        """Forget the present span: the vehicle is not in flight."""
        self._start = None

    def gain(self, velocity: Sequence[float]) -> None:
        """Add what the controls explain of a change of the velocity, m/s.

        At most upwards along x, y and z, then at most downwards.
        """
        self._gained = [a + b for a, b in zip(self._gained, velocity, strict=True)]

    def is_due(self, time: float) -> bool:
        """Return whether a span has ended, or none has begun, at ``time`` (s)."""
        return self._start is None or not 0.0 <= time - self._start[0] < SPAN

    def compare(self, time: float, velocity: Sequence[float]) -> None:
        """End a span at ``time`` (s) with a measured velocity (m/s), and begin the next."""
        start = self._start
        if start is not None and 0.0 < time - start[0] < 2.0 * SPAN:
            up, down = self._gained[:3], self._gained[3:]
            changes = zip(velocity, start[1], up, down, self._errors, self.widest, strict=True)
            self.widest = [
                max(
                    (max(v - v0 - most, v0 - v - least) - 2.0 * error) / (time - start[0]),
                    _FADE * old,
                )
                for v, v0, most, least, error, old in changes
            ]
        self._start, self._gained = (time, velocity), [0.0] * 6
