"""Monitors of a vehicle's log: its battery, its estimator, its liftoff and its touchdown."""

import enum
from typing import NamedTuple

from crazyflie_driver.setpoint_gate import STREAM_PAUSE
from crazyflie_model.limits import LEVEL_AGE


class Charge(enum.IntEnum):
    """Charge of a battery; the numbers are those of crazyflie_msgs/VehicleStatus."""

    UNKNOWN = 0
    GOOD = 1
    LOW = 2
    CRITICAL = 3


class BatteryMonitor:
    """The charge of a battery by its voltage and two limits (V).

    The charge is critical once the voltage has been below its limit for a time (s), since it sinks
    under load. It stays critical until the voltage is no longer low, since it rises with less load.
    """

    def __init__(self, low: float, critical: float, critical_time: float):
        self._low, self._critical, self._time = low, critical, critical_time
        self._critical_since: float | None = None
        self.voltage: float | None = None
        self.charge = Charge.UNKNOWN

    def update(self, voltage: float, now: float) -> Charge:
        """Return the charge after a voltage (V) at a time (s)."""
        self.voltage = voltage
        if not voltage < self._critical:
            self._critical_since = None
        elif self._critical_since is None:
            self._critical_since = now
        since = self._critical_since
        is_low = voltage < self._low
        if since is not None and now - since >= self._time:
            self.charge = Charge.CRITICAL
        elif is_low and self.charge is not Charge.CRITICAL:
            self.charge = Charge.LOW
        elif not is_low:
            self.charge = Charge.GOOD
        return self.charge

    def words(self) -> str:
        """Return the state, such as "battery low: 3.12 V"; empty if nothing is wrong."""
        return "" if self.voltage is None else battery_words(self.charge, self.voltage)


def battery_words(charge: Charge, voltage: float) -> str:
    """Return a state, such as "battery low: 3.12 V"; empty if nothing is wrong."""
    if charge == Charge.CRITICAL:
        return f"battery critical: {voltage:.2f} V"
    return f"battery low: {voltage:.2f} V" if charge == Charge.LOW else ""


#: Log variables of the variances of a Kalman filter's velocity, m^2/s^2, and their period (ms).
VARIANCES, VARIANCES_PERIOD_MS = ("kalman.varPX", "kalman.varPY", "kalman.varPZ"), 500

#: Number of samples in which a variance of a filter that has converged changes by less than
#: `MAX_CHANGE`, m^2/s^2: as in cflib.crazyflie.reset_estimator. A shorter window is held to the
#: same rate.
WINDOW = 10
MAX_CHANGE = 0.001
FEWEST = 3  #: The shortest window.


class Variances:
    """Whether a Kalman filter has converged, by samples of `VARIANCES`."""

    def __init__(self) -> None:
        self._samples: tuple[tuple[float, ...], ...] = ()
        self.is_logged = False

    @property
    def are_enough(self) -> bool:
        """Whether there are as many samples as `problem` needs, or none are logged."""
        return not self.is_logged or len(self._samples) >= FEWEST

    def add(self, sample: tuple[float, ...]) -> None:
        """Add a sample of `VARIANCES`."""
        self._samples = (*self._samples, sample)[-WINDOW:]

    def clear(self) -> None:
        """Forget all samples: the filter may have been restarted."""
        self._samples = ()

    def problem(self) -> str:
        """Return the evidence that the filter has not converged; empty without any."""
        samples = self._samples
        if len(samples) < FEWEST:
            return ""
        windows = [samples[-size:] for size in range(FEWEST, len(samples) + 1)]
        problems = [_excess(window) for window in windows]
        # The last problem is that of the longest window.
        return "" if "" in problems else problems[-1]


def _excess(window):
    span = (len(window) - 1) * VARIANCES_PERIOD_MS / 1000.0
    most = MAX_CHANGE * (len(window) - 1) / (WINDOW - 1)
    changes = [max(values) - min(values) for values in zip(*window, strict=True)]
    worst = max(range(len(changes)), key=changes.__getitem__)
    # NaN is not less than anything, and so is too large.
    if all(change < most for change in changes):
        return ""
    return (
        f"{VARIANCES[worst]} has changed by {changes[worst]:.2g} m^2/s^2 within {span:g} s; "
        f"expected less than {most:.2g}"
    )


LIFT_LIMIT = 2.0  #: Time in which a vehicle must lift off (s).
MIN_CLIMB = 0.15  #: Least height of setpoints above the ground that command a flight (m).
MAX_RISE = 0.05  #: Largest estimated height of a vehicle on the ground (m).
MAX_TURN = 10.0  #: Largest turn from the heading on the ground to the commanded one, degrees.

MAX_REST_SPEED = 0.1  #: Largest estimated vertical speed of a vehicle on the ground (m/s).


class NoLift(NamedTuple):
    """A vehicle that has not lifted off to a height (m).

    It is certain if the estimate, and not only the supervisor, says that it is on the ground.
    """

    height: float
    is_certain: bool


class LiftWatch:
    """Whether a vehicle lifts off when setpoints ask for it; times in s.

    While the ground holds a vehicle, the firmware's integrators wind up, and the vehicle leaps as
    soon as it is free; so it does when a position is commanded with another heading than its own.
    The supervisor's FLYING does not show a liftoff: thrust sets it. A vehicle whose estimate moves
    may be flying: where motion capture is frozen, the estimated height hardly rises, but the
    vertical speed, which the accelerometer drives, is that of the flight.
    """

    def __init__(self) -> None:
        self._is_on_ground = False
        self._ground: float | None = None
        self._height = 0.0
        self._latest: float | None = None
        self._begin: float | None = None
        self._is_reported = False

    def end(self) -> None:
        """End the attempt: setpoints have stopped."""
        self._begin, self._latest, self._is_reported = None, None, False

    def command(self, now: float, height: float | None) -> bool:
        """Record a setpoint that was sent; return whether an attempt to lift off begins.

        Its height is in m, in the frame of the estimate; None if it commands none.
        """
        if self._latest is not None and now - self._latest > STREAM_PAUSE:
            self.end()
        self._latest = now
        if height is None or not self._is_on_ground or height - (self._ground or 0.0) < MIN_CLIMB:
            self._begin = None
            return False
        self._height = height
        begins = self._begin is None
        if begins:
            self._begin = now
        return begins

    def sample(
        self, now: float, is_flying: bool | None, height: float | None, speed: float | None
    ) -> NoLift | None:
        """Return the failure to lift off, once in an attempt; otherwise None.

        Whether the supervisor reports a flight, the estimate's height (m) and vertical speed (m/s)
        are None while they are not known.
        """
        if self._begin is None and is_flying is False:
            self._is_on_ground, self._ground = True, height
        elif is_flying is None or self._has_left(is_flying, height, speed):
            self._is_on_ground, self._begin = False, None
        if self._begin is None or self._latest is None or self._is_reported:
            return None
        if now - self._begin < LIFT_LIMIT or now - self._latest > LEVEL_AGE:
            return None
        self._is_reported = True
        return NoLift(self._height, height is not None and speed is not None)

    def _has_left(self, is_flying, height, speed):
        if height is None or speed is None or self._ground is None:
            return is_flying
        return abs(height - self._ground) > MAX_RISE or abs(speed) > MAX_REST_SPEED


LANDING_SPEED = 0.5  #: Mean speed of a landing, m/s.
#: Distance (m) and duration (s) of a descent below the expected ground.
STEP, STEP_TIME = (0.5, 1.5)
MAX_DEPTH = 3.0  #: The descents go no further below it, m.
#: The next descent begins this long before one ends, and the firmware stops the motors with it, s.
LEAD = 0.4

#: A vehicle that stands changes its estimated height by no more than `MAX_DROP`, m, while its
#: target sinks by `MIN_WAY`, m, to `MIN_DISTANCE` below it, m, for `HOLD`, s: three samples or more
#: of a log with 10 Hz. A vehicle that hovers may be above its target, too.
MAX_DROP, MIN_WAY, MIN_DISTANCE, HOLD = 0.02, 0.15, 0.1, 0.4


def landing_duration(height: float | None, least: float, most: float) -> float:
    """Return the duration of a landing from a height (m, None if it is not known), s.

    It is at least ``least``, and at most ``most``, whatever the height.
    """
    return min(least if height is None else max(least, height / LANDING_SPEED), most)


class Next(enum.Enum):
    """The next step of a landing."""

    NOTHING = enum.auto()
    DESCENT = enum.auto()  #: A descent by `STEP`: no ground was met.
    STOP = enum.auto()  #: The motors stop: the vehicle is on the ground.


class Touchdown:
    """The end of a landing at a height (m), in a duration (s) from ``now`` (s) on.

    The height of the ground is not known: a vehicle may have started from a table, or the origin of
    its estimate may be one. Therefore a height is not a touchdown: a vehicle is down when it has
    stopped sinking although it is commanded to sink.
    """

    def __init__(self, now: float, height: float, duration: float):
        self.begin = now
        self._end = now + duration
        self._ground = height
        # Time, height and target when the vehicle was last seen to move.
        self._rest: tuple[float, float, float] | None = None

    def descend(self, now: float) -> None:
        """Begin a descent by `STEP`."""
        self._end = now + STEP_TIME

    def sample(
        self, now: float, height: float | None, speed: float | None, target: float | None
    ) -> Next:
        """Return the next step after an estimate; nothing while a part of it is not known.

        It has height and vertical speed (m and m/s); the target is the height that is commanded.
        """
        if height is None or speed is None or target is None:
            return Next.NOTHING
        if self._stands(now, height, speed, target):
            return Next.STOP
        # If the vehicle is higher, another command has replaced the landing.
        goes_on = self._ground - MAX_DEPTH <= height - STEP < self._ground
        return Next.DESCENT if goes_on and now >= self._end - LEAD else Next.NOTHING

    def _stands(self, now, height, speed, target):
        is_moving = abs(speed) > MAX_REST_SPEED
        if self._rest is None or is_moving or abs(height - self._rest[1]) > MAX_DROP:
            self._rest = now, height, target
        since, _, before = self._rest
        is_commanded = before - target >= MIN_WAY and height - target >= MIN_DISTANCE
        return is_commanded and now - since >= HOLD
