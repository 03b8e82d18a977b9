"""Whether a vehicle's own estimate can be flown by: its decks, the filter, and external poses."""

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from crazyflie_utils import ServiceError
from mocap_optitrack.frame_times import ClockOffset, FrameOrder

MOCAP, FLOW, LIGHTHOUSE, LOCO = "mocap", "flow", "lighthouse", "loco"
#: Sources of a vehicle's pose: motion capture, or its own estimate by one of its decks.
SOURCES = (MOCAP, LIGHTHOUSE, FLOW, LOCO)

PERIOD_MS = 100  #: Period at which the state of the decks is logged, ms.
MAX_AGE = 0.5  #: A state of the decks that is older, s, is not known.

#: Duration of a problem after which the flight ends (s): no more poses are published, and the nodes
#: that fly the vehicle by them react as to the loss of motion capture. Also the longest gap between
#: external poses.
PATIENCE = 0.5
#: Duration of a stream of external poses that a flight depends on (s): a pose that is sent once, to
#: set the estimate, is none.
MIN_STREAM = 1.0

#: Largest standard deviation of the filter: position by Lighthouse and Loco (m), horizontal
#: velocity by optical flow (m/s). A converged filter has less than half of the least of them.
MAX_DEVIATIONS = {LIGHTHOUSE: 0.05, LOCO: 0.15, FLOW: 0.1}

#: Reading of the Flow deck's ranging sensor from which on the firmware's filter does not use it
#: (mm). The log has the raw readings, which end at 5,000 to 8,190: zranger2.c of the firmware.
OUT_OF_REACH = 5000

_POSITION = ("kalman.varX", "kalman.varY", "kalman.varZ")

Values = Mapping[str, float]

ESTIMATOR = "stabilizer.estimator"  #: Parameter of the firmware: number of its estimator.
#: Numbers of the complementary filter, which a vehicle without decks begins with, and of the
#: extended Kalman filter.
COMPLEMENTARY, KALMAN = 1, 2

#: Log variables of the estimated position, m, fixed frame.
ESTIMATE = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z")
#: Largest distance of the estimate from the poses that a vehicle is sent, m; a Kalman filter
#: follows them within a few mm.
MAX_POSE_DISTANCE = 0.3
#: Age up to which a pose may be the one of an estimate: the filter and the link are late, s.
_POSE_WINDOW = 0.5
_MAX_ESTIMATE_AGE = 1.5  #: An estimate that is older is not known, s: three periods of its log.


def estimator_problem(number: float | None) -> str:
    """Return why a vehicle with this estimator has no position; empty if it has, or unknown."""
    if number != COMPLEMENTARY:
        return ""
    return (
        f"{ESTIMATOR} is {COMPLEMENTARY} (complementary): it ignores external poses, x and y are "
        f"always 0, and z is that of the barometer; expected {KALMAN} (Kalman), set it with "
        "update_params"
    )


#: Least distance (m) between poses of a flight that are not of one vehicle, and the speed (m/s) at
#: which it can have moved in between, for at most some time (s).
_JUMP, _MAX_SPEED, _MAX_GAP = 0.3, 5.0, 0.2


class PoseAgreement:
    """Whether a vehicle's estimate is where the external poses say; times in s of one clock."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Sequence[float]]] = deque()
        self._time = -math.inf
        self._text = ""
        # Begin and latest pose of the present, or last, stream.
        self._stream_begin = self._latest = -math.inf
        # Time and place of the latest one that did not jump.
        self._place: tuple[float, Sequence[float]] | None = None

    def jump(self, now: float, position: Sequence[float], is_flying: bool) -> float:
        """Return how far a pose in flight is from the one before (m) if it jumps, otherwise 0."""
        if is_flying and self._place is not None:
            time, place = self._place
            distance = math.dist(place, position)
            if distance > _JUMP + _MAX_SPEED * min(now - time, _MAX_GAP):
                return distance
        # The link refuses others.
        if all(map(math.isfinite, position)):
            self._place = now, tuple(position)
        return 0.0

    def pose(self, now: float, position: Sequence[float]) -> None:
        """Record a position (m) that the vehicle is sent."""
        self._forget_old(now)
        self._poses.append((now, tuple(position)))
        if now - self._latest > PATIENCE:
            self._stream_begin = now
        self._latest = now

    def is_lost(self, now: float, begin: float) -> bool:
        """Return whether a stream of poses has stopped in a flight that began at ``begin``."""
        is_stream = self._latest - self._stream_begin >= MIN_STREAM
        return is_stream and now - self._latest > PATIENCE >= begin - self._latest

    def estimate(self, now: float, position: Sequence[float]) -> None:
        """Record an estimated position (m), and compare it with the poses of the last 0.5 s."""
        self._forget_old(now)
        self._time, self._text = now, ""
        if not self._poses:
            return
        distances = [math.dist(position, pose) for _, pose in self._poses]
        # NaN is not within any limit.
        if any(distance <= MAX_POSE_DISTANCE for distance in distances):
            return
        self._text = (
            f"the vehicle estimates its position as {_place(position)} m, and is sent "
            f"{_place(self._poses[-1][1])} m, {distances[-1]:.2f} m from it; expected at most "
            f"{MAX_POSE_DISTANCE:g} m: is it the pose of this vehicle, and in the right frame?"
        )

    def problem(self, now: float) -> str:
        """Return the difference that is too large; empty without one, or if it is not known."""
        return self._text if now - self._time <= _MAX_ESTIMATE_AGE else ""

    def _forget_old(self, now):
        while self._poses and now - self._poses[0][0] > _POSE_WINDOW:
            self._poses.popleft()


def _place(position):
    return "({})".format(", ".join(f"{part:.2f}" for part in position))


def _flow(values: Values) -> str:
    height = values["range.zrange"]
    if height >= OUT_OF_REACH:
        return f"the Flow deck sees no ground within its reach (range.zrange is {height:.0f} mm)"
    deviation = _deviation(values, "kalman.varPX", "kalman.varPY")
    return _excess(FLOW, "velocity", deviation, "m/s", "has the floor texture, and light?")


def _lighthouse(values: Values) -> str:
    received = int(values["lighthouse.bsReceive"])
    lacking = [
        what
        for what, name in (("geometry", "bsGeoVal"), ("calibration", "bsCalVal"))
        if not received & int(values[f"lighthouse.{name}"])
    ]
    if not received:
        return "the Lighthouse deck receives no base station (lighthouse.bsReceive is 0)"
    if lacking:
        return (
            f"the vehicle has no {' and no '.join(lacking)} of the base stations that it receives "
            f"(lighthouse.bsReceive is {received}); write them with the service write_lighthouse"
        )
    return _position(LIGHTHOUSE, values)


def _position(system: str, values: Values) -> str:
    deviation = _deviation(values, *_POSITION)
    return _excess(system, "position", deviation, "m", "does it see enough of its system?")


def _deviation(values, *names):
    return math.sqrt(max((values[name] for name in names), key=lambda v: (v != v, v)))


def _excess(system, what, deviation, unit, question):
    limit = MAX_DEVIATIONS[system]
    if deviation <= limit:
        return ""
    return (
        f"the vehicle estimates its {what} with a deviation of {deviation:.2f} {unit}, expected at "
        f"most {limit:g} {unit}; {question}"
    )


@dataclass(frozen=True)
class System:
    """A positioning system: names of its decks, in words and as firmware parameters."""

    deck: str
    parameters: tuple[str, ...]  # One of them is not 0 where the deck is there.
    variables: tuple[str, ...]  # Log variables that show the state.
    problem: Callable[[Values], str]  # Returns the fault of the state; empty without a fault.


SYSTEMS = {
    FLOW: System(
        "Flow deck",
        ("deck.bcFlow2", "deck.bcFlow"),
        ("range.zrange", "kalman.varPX", "kalman.varPY"),
        _flow,
    ),
    LIGHTHOUSE: System(
        "Lighthouse deck",
        ("deck.bcLighthouse4",),
        ("lighthouse.bsReceive", "lighthouse.bsGeoVal", "lighthouse.bsCalVal", *_POSITION),
        _lighthouse,
    ),
    LOCO: System(
        "Loco Positioning deck",
        ("deck.bcDWM1000", "deck.bcLoco"),
        _POSITION,
        partial(_position, LOCO),
    ),
}


def check_deck(source: str, parameters: Values) -> None:
    """Raise `ServiceError` if firmware parameters, by name, show no deck of a source."""
    system = SYSTEMS[source]
    if any(parameters.get(name) for name in system.parameters):
        return
    prefix = "deck."
    found = [name for name, value in parameters.items() if name.startswith(prefix) and value]
    raise ServiceError(
        f"positioning is {source}, and the vehicle has no {system.deck} "
        f"({' and '.join(system.parameters)} 0); it has {', '.join(sorted(found)) or 'no deck'}. "
        "Expected the deck, or another positioning"
    )


@dataclass(eq=False)
class Positioning:
    """The state of a vehicle's positioning by one of `SYSTEMS`; times in s of one clock."""

    source: str
    _clock: ClockOffset = field(default_factory=ClockOffset)
    _problem: str = "the state of its positioning has not come"
    _time: float = -math.inf
    _good: float = -math.inf  # Last time without a problem.
    # Why the estimate may be that of another place, and when it is that of the right one again.
    _suspended: str = ""
    _begin: float = -math.inf

    def update(self, now: float, values: Sequence[float]) -> None:
        """Record the values of the system's variables."""
        system = SYSTEMS[self.source]
        self._problem = system.problem(dict(zip(system.variables, values, strict=True)))
        self._time = now
        if not self._problem:
            self._good = now

    def suspend(self, reason: str) -> None:
        """Do not use the estimate until `resume`: the vehicle may believe that it is elsewhere."""
        self._suspended = reason

    def resume(self, begin: float = -math.inf) -> None:
        """Use the estimate again, from a time (s) on."""
        self._begin, self._suspended = begin, ""

    def is_usable(self, now: float) -> bool:
        """Return whether the estimate may be published as the vehicle's pose."""
        return not (self._suspended or now < self._begin or self.is_lost(now))

    def problem(self, now: float) -> str:
        """Return why a flight must not begin, or must end; empty if it may go on."""
        if self._suspended:
            return self._suspended
        if now < self._begin:
            return "its estimate has been reset"
        if now - self._time > MAX_AGE and not math.isinf(self._time):
            return f"the state of its positioning has not come for {now - self._time:.1f} s"
        return self._problem

    def is_lost(self, now: float) -> bool:
        """Return whether the estimate cannot be flown by: a problem lasts."""
        return now - self._good > PATIENCE

    def local_time(self, sent: float, arrival: float) -> float | None:
        """Return when an estimate was made, by the local clock; None if it is not to be used.

        It was sent at a time of the vehicle's clock, and arrived at one of the local clock. The
        offset of the clocks is that of the messages with the shortest delay, as it is with motion
        capture.
        """
        order = self._clock.update(sent, arrival)
        if order in (FrameOrder.OLD, FrameOrder.FOREIGN) or not self._clock.is_settled:
            return None
        return min(self._clock.to_local(sent), arrival)
