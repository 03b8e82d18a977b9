"""What the supervisor does when anything fails: the table of its guards.

A stranger can read here what this vehicle does. In a phase, the first row that fires decides;
`crazyflie_takeoff.supervisor.judge` runs the table, and the diagram and the table in the README
are made of it.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

from crazyflie_model.units import GRAVITY
from crazyflie_takeoff.facts import Facts
from crazyflie_takeoff.fallback import MOTORS_OFF, RETURN_TIME, SafeControl, SafeSetpoint
from crazyflie_takeoff.phases import FlightState, Phase

CRASH_DURATION = 0.1  #: Time for which a position is wrong in a crash (s).
#: Time after which a flight is over if the vehicle cannot fly (s). The firmware stops the motors as
#: long after the last setpoint.
MAX_FAULT_TIME = 2.0
CLIMB_TIMEOUT = 2.0  #: Time of controls that climb too fast after which the flight is ended (s).
DESCENT_TIMEOUT = 1.5  #: Longest time that a vehicle which is to land may stay up (s).
#: Time that a filter listens when it starts, before it passes commanded controls (s): some periods
#: of the zero thrust on the ground, and less than a vehicle flies on without controls.
LISTENING_TIME = 0.4
RESET_DELAY = 2.0  #: Time after an emergency in which a vehicle may still fall (s).


@dataclass(slots=True)
class Memory:
    """What the supervisor remembers beside the facts; times are `Facts.ran` or `Facts.now`, s."""

    phase: Phase = Phase.LISTENING
    since: float = 0.0  # When the phase began (ran).
    reason: str = ""  # Why the supervisor keeps the vehicle from its controller.
    cause: str = ""  # Why it brings the vehicle down.
    flight_begun: float = math.inf  # When the vehicle has left the ground (now).
    firing: dict[str, float] = field(default_factory=dict)  # Since when guards fire, by name (ran).
    clear_until: float = -math.inf  # Until when no guard can fire (now).
    takeovers: int = 0  # Number of times that the vehicle was held.
    passed: Any = None  # The last commanded control that has passed; None before the first one.
    takeoff: SafeSetpoint = MOTORS_OFF  # The last takeoff control as it has passed.
    # The supervisor's own control since it has taken over, and when it was calculated (now).
    fallback: SafeControl | None = None
    own: SafeSetpoint = MOTORS_OFF
    own_at: float = math.nan
    descent_limit: float = 0.0  # Longest duration of the present descent (s).

    def elapsed(self, facts: Facts) -> float:
        """Return the time since the phase began, s."""
        return facts.ran - self.since


@dataclass(frozen=True)
class Guard:
    """A row: in some phases, if something holds for a time, the next phase begins.

    ``fires`` returns whether it holds, or a text that says what does. ``says`` is the reason that
    people are told, with that text in place of {}, and the cause of a descent in place of {cause};
    it is empty if nothing is wrong. ``after`` is the time, s, or the parameter that has it, which
    ``fires`` compares itself.
    """

    name: str
    phases: tuple[Any, ...]
    fires: Callable[[Any, Any], str | bool]
    next: Any
    says: str = ""
    after: float | str = 0.0


def first_firing(
    rows: Iterable[Guard], since: dict[str, float], now: float, facts: Any, memory: Any
) -> tuple[Guard, str] | None:
    """Return the first row that fires for long enough, and the text that it returns; or None.

    ``since`` has the times at which rows have begun to fire, by name, and is kept up to date;
    ``now`` is of the same clock, s.
    """
    for row in rows:
        if not (said := row.fires(facts, memory)):
            if since:
                since.pop(row.name, None)
        elif isinstance(row.after, str) or now - since.setdefault(row.name, now) >= row.after:
            return row, said if isinstance(said, str) else ""
    return None


def _tipped(facts, memory):
    return facts.is_tilted


def _outside(facts, memory):
    return "" if facts.seen is None else facts.outside


def _vehicle_fault(facts, memory):
    vehicle = facts.vehicle
    return "" if vehicle is None else vehicle.flight_fault(facts.now, memory.flight_begun)


def _control_is_lost(facts, memory):
    return facts.needs_controller and facts.silence > facts.hold


def _control_is_back(facts, memory):
    is_heard = facts.is_commanded and facts.silence <= facts.hold
    return is_heard and facts.needs_controller


def _control_stays_away(facts, memory):
    if not facts.needs_controller:
        return ""
    timeouts, elapsed = facts.timeouts, memory.elapsed(facts)
    is_flying = facts.remembered is FlightState.FLYING
    longest = timeouts.place if is_flying else timeouts.recovery
    blind = min(elapsed, facts.measured.age(facts.now))
    is_over = elapsed > longest or blind > timeouts.recovery
    return f"no control came for {facts.hold + elapsed:.1f} s" if is_over else ""


def _began_on_ground(facts, memory):
    if not (facts.in_flight and facts.ground.is_below(facts.seen)):
        return False
    return (
        facts.is_commanded if memory.phase is Phase.LISTENING else facts.first_seen > memory.since
    )


def _began_in_flight(facts, memory):
    seen = facts.seen
    is_checked = not facts.sees or seen is not None
    # In a takeoff the controller flies it once the server sends no takeoff controls any more.
    is_lifted = facts.flight is FlightState.TAKING_OFF and seen and not facts.ground.is_below(seen)
    return (facts.in_flight or is_lifted) and facts.is_commanded and is_checked


def _has_listened(facts, memory):
    # Where no server is, none says whether the vehicle flies; without states it is not waited for.
    is_there = facts.ran - facts.server_missed > LISTENING_TIME
    return facts.has_listened and (is_there or not facts.sees)


def _touched_down(facts, memory):
    return facts.ground.has_touched_down(facts.seen)


def _descent_is_over(facts, memory):
    limit = memory.descent_limit
    is_over = memory.elapsed(facts) > limit and not facts.ground.sinks(facts.seen)
    return f"{limit:.1f} s" if is_over else ""


def _lifts_off(facts, memory):
    # A server of another kind says it by its thrust alone.
    is_lifted = facts.kept.ran > memory.since and facts.kept_thrust > GRAVITY
    return is_lifted or facts.takeoff_called > memory.since


_P = Phase
#: The server and the controller fly the vehicle.
FLOWN = (_P.PASSING, _P.RETURNING)
#: The vehicle is in the air, and the supervisor has not decided yet to bring it down.
HELD = (*FLOWN, _P.HOLDING)
AIRBORNE = (*HELD, _P.SINKING)
TILTED = "the vehicle has tilted over"
LANDS = "{}; the filter lands"
STAYS_UP = f"the vehicle has not come down for {DESCENT_TIMEOUT:g} s of a landing"
_ALL_BUT_EMERGENCY = tuple(phase for phase in Phase if phase is not _P.EMERGENCY)

CONTROL_STAYS_AWAY = Guard(
    "control stays away",
    (_P.HOLDING,),
    _control_stays_away,
    _P.SINKING,
    "{}",
    "loss/place_limit, loss/return_limit",
)

GUARDS: tuple[Guard, ...] = (
    Guard("emergency", _ALL_BUT_EMERGENCY, lambda f, m: f.emergency, _P.EMERGENCY, "{}"),
    Guard("on the ground", (_P.PASSING,), lambda f, m: f.stands, _P.ON_GROUND),
    Guard("off the ground", (_P.ON_GROUND,), lambda f, m: not f.stands, _P.PASSING),
    Guard("tipped over", AIRBORNE, _tipped, _P.EMERGENCY, TILTED),
    Guard("out of bounds", AIRBORNE, _outside, _P.EMERGENCY, "{}", CRASH_DURATION),
    Guard("vehicle cannot fly", AIRBORNE, _vehicle_fault, _P.DOWN, "{}", MAX_FAULT_TIME),
    Guard("two publishers", HELD, lambda f, m: f.contention, _P.SINKING, LANDS),
    Guard("climbs", HELD, lambda f, m: f.climb_excess, _P.SINKING, LANDS, CLIMB_TIMEOUT),
    Guard("busy computer", HELD, lambda f, m: f.pauses.complaint, _P.SINKING, LANDS),
    Guard(
        "does not come down",
        FLOWN,
        lambda f, m: f.stays_up and STAYS_UP,
        _P.SINKING,
        LANDS,
        DESCENT_TIMEOUT,
    ),
    Guard(
        "began on the ground",
        (_P.LISTENING, _P.HOLDING),
        _began_on_ground,
        _P.DOWN,
        "the vehicle was on the ground when the filter began",
    ),
    Guard("began in flight", (_P.LISTENING,), _began_in_flight, _P.PASSING),
    Guard("has listened", (_P.LISTENING,), _has_listened, _P.PASSING),
    Guard("server is there", (_P.LISTENING,), lambda f, m: f.kept.ran >= 0.0, _P.PASSING),
    Guard(
        "no control",
        (_P.LISTENING, *FLOWN),
        _control_is_lost,
        _P.HOLDING,
        "no control comes, the filter keeps the vehicle in place",
        "loss/hold_after",
    ),
    Guard("control is back", (_P.HOLDING,), _control_is_back, _P.RETURNING),
    Guard(
        "server flies", (_P.HOLDING, _P.RETURNING), lambda f, m: not f.needs_controller, _P.PASSING
    ),
    CONTROL_STAYS_AWAY,
    Guard(
        "return is over",
        (_P.RETURNING,),
        lambda f, m: m.elapsed(f) >= RETURN_TIME,
        _P.PASSING,
    ),
    Guard(
        "touchdown",
        (_P.SINKING,),
        _touched_down,
        _P.DOWN,
        "brought down by the filter because {cause}",
    ),
    Guard(
        "descent is too long",
        (_P.SINKING,),
        _descent_is_over,
        _P.DOWN,
        "motors stopped after {} of descent: {cause}",
        "loss/descent_limit",
    ),
    Guard("takeoff", (_P.DOWN,), _lifts_off, _P.ON_GROUND),
    Guard(
        "reset",
        (_P.EMERGENCY,),
        lambda f, m: f.is_reset and m.elapsed(f) >= RESET_DELAY,
        _P.DOWN,
        "reset after an emergency",
    ),
)
