"""Thrust of a vehicle whose stream of thrust has stopped in flight."""

from collections import deque

from crazyflie_model.limits import LEVEL_AGE

#: Silence after which the fade begins, s: that after which the firmware levels the vehicle out. A
#: stream may have gaps of this length. The firmware stops the motors 2 s after the end of the fade.
FADE_BEGIN = LEVEL_AGE
FADE_TIME = 1.5  #: Duration of the fade, s.
FADE_END = 0.93  #: Thrust at its end, as a share of the one at its begin: the vehicle sinks.
WINDOW = 1.0  #: Time over which the thrust is averaged, s.


class ThrustFade:
    """The thrust (PWM) of level setpoints after a stream has stopped; times in s of one clock.

    It begins with the mean of the last second, which is about the thrust of hover: a single thrust
    may be that of a climb.
    """

    def __init__(self) -> None:
        self._thrusts: deque[tuple[float, float]] = deque()

    def command(self, now: float, thrust: float) -> None:
        """Record the thrust of a setpoint that was sent."""
        self._thrusts.append((now, thrust))
        while now - self._thrusts[0][0] > WINDOW:
            self._thrusts.popleft()

    def thrust(self, now: float) -> float | None:
        """Return the thrust to send; None while the stream is fresh, and after the fade."""
        if not self._thrusts:
            return None
        elapsed = now - self._thrusts[-1][0] - FADE_BEGIN
        if not 0.0 <= elapsed <= FADE_TIME:
            return None
        mean = sum(thrust for _, thrust in self._thrusts) / len(self._thrusts)
        return mean * (1.0 - (1.0 - FADE_END) * elapsed / FADE_TIME)
