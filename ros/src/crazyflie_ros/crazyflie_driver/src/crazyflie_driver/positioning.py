"""Whether a vehicle's own estimate can be flown by: its decks, their state and the filter's."""

import math
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
#: that fly the vehicle by them react as to the loss of motion capture.
PATIENCE = 0.5

#: Largest standard deviation of the filter: position by Lighthouse and Loco (m), horizontal
#: velocity by optical flow (m/s). A converged filter has less than half of the least of them.
MAX_DEVIATIONS = {LIGHTHOUSE: 0.05, LOCO: 0.15, FLOW: 0.1}

#: Reading of the Flow deck's ranging sensor without an object in its range (mm).
OUT_OF_REACH = 32000

_POSITION = ("kalman.varX", "kalman.varY", "kalman.varZ")

Values = Mapping[str, float]


def _flow(values: Values) -> str:
    height = values["range.zrange"]
    if height >= OUT_OF_REACH:
        return "the Flow deck sees no ground within its reach (range.zrange)"
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

    def update(self, now: float, values: Sequence[float]) -> None:
        """Record the values of the system's variables."""
        system = SYSTEMS[self.source]
        self._problem = system.problem(dict(zip(system.variables, values, strict=True)))
        self._time = now
        if not self._problem:
            self._good = now

    def problem(self, now: float) -> str:
        """Return why a flight must not begin, or must end; empty if it may go on."""
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
