"""The supervisor of a flight: a function that selects or makes the control of the vehicle.

``step(memory, facts, given)`` looks at the facts, makes the transitions of `GUARDS`, and returns
the control to send: the given one unchanged, a `SafeSetpoint` in place of it, or None. Call it for
each control, and every 10 ms for the time; 40 ms are enough while `may_look_rarely`.

Takeoff controls pass always. Commanded controls pass in flight, and when the last takeoff control
is older than `TAKEOFF_CONTROL_LIMIT`; otherwise the last takeoff control is repeated. On the ground
the flight state also excludes commanded controls if the server has died and does not repeat zero
thrust: the controller may have a reference high above.
"""

import enum
import math
from dataclasses import replace
from typing import Any

from crazyflie_model.limits import MIN_THRUST
from crazyflie_takeoff.envelope import LANDING_CLIMB, TAKEOFF_CLIMB, within_climb, within_pause
from crazyflie_takeoff.facts import TAKEOFF_CONTROL_LIMIT, Facts
from crazyflie_takeoff.fallback import (
    LONGEST_STEP,
    MAX_SUBSTITUTE,
    MOTORS_OFF,
    RETURN_TIME,
    SafeControl,
    SafeSetpoint,
    descent_time,
)
from crazyflie_takeoff.guards import (
    CONTROL_STAYS_AWAY,
    GUARDS,
    RESET_DELAY,
    Guard,
    Memory,
    first_firing,
)
from crazyflie_takeoff.hover_thrust import UNSEEN_THRUST
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.phases import FlightState, Phase
from crazyflie_utils.refusal import RefusalError

GUESS_TIME = 0.6  #: Learning time before which the thrust of hover is not known (s).
LEARNING_TIME = 2.0  #: Learning time before which it may be some per cent too high (s).
LEARNING_SHARE = 0.9  #: Share of it with which a vehicle surely sinks then.
LAST_STATE = 0.7  #: Age of the oldest state from which the motion is predicted (s).

_BY_PHASE = {phase: [row for row in GUARDS if phase in row.phases] for phase in Phase}


class Given(enum.Enum):
    """What a step is made for."""

    TIME = enum.auto()
    TAKEOFF = enum.auto()  # `Facts.takeoff` has just come.
    COMMANDED = enum.auto()  # `Facts.commanded` has just come.


def passes(memory: Memory, facts: Facts, now: float, control: Any, age: float) -> bool:
    """Return whether a commanded control passes unchanged, without a step.

    In a nominal flight nearly all controls do. ``control`` has the fields of a setpoint, and comes
    from the node that has sent the last one; for ``age`` see `Facts.hear_commanded`.
    """
    half = 0.5 * facts.hold
    is_clear = 0.0 < memory.clear_until - now <= LONGEST_STEP
    if not (is_clear and age < half and facts.limits.contain(control)):
        return False
    facts.advance(now)
    facts.measure_period(now)
    facts.commanded.now, facts.commanded.ran = now, max(facts.commanded.ran, facts.ran - age)
    memory.passed = facts.flown = control
    return True


def measure(memory: Memory, facts: Facts, now: float, motion: Motion, age: float) -> None:
    """Process a state that was measured ``age`` s ago; see `Facts.measure`."""
    facts.measure(now, motion, age)
    if not facts.is_free:
        memory.clear_until = -math.inf


def step(memory: Memory, facts: Facts, given: Given) -> Any:
    """Look at the facts and return the control to send, or None; see the module."""
    if facts.seen is None:
        facts.learn()
    if given is Given.TIME and _is_clear(memory, facts):
        memory.clear_until = facts.now + LONGEST_STEP
        return None
    facts.look()
    if given is Given.TAKEOFF:
        _keep_takeoff(memory, facts)
    judge(memory, facts)
    if given is Given.TAKEOFF:
        return _pass_takeoff(memory, facts)
    if given is Given.COMMANDED:
        return _pass_commanded(memory, facts)
    memory.clear_until = facts.now + LONGEST_STEP if _is_nominal(memory, facts) else -math.inf
    return _substitute(memory, facts)


def judge(memory: Memory, facts: Facts) -> None:
    """Make the transitions of the guards that fire."""
    memory.clear_until = -math.inf
    rows = _BY_PHASE[memory.phase]
    while found := first_firing(rows, memory.firing, facts.ran, facts, memory):
        _enter(memory, facts, *found)
        rows = _BY_PHASE[memory.phase]


def _enter(memory: Memory, facts: Facts, row: Guard, said: str) -> None:
    before, memory.phase, memory.since = memory.phase, row.next, facts.ran
    # What has fired in the last phase goes on in this one, if it is a guard of both.
    lasting = {each.name for each in _BY_PHASE[row.next]} - {row.name}
    memory.firing = {name: since for name, since in memory.firing.items() if name in lasting}
    if before in (Phase.LISTENING, Phase.ON_GROUND, Phase.DOWN):
        memory.flight_begun, facts.learned_for = facts.now, 0.0
    if before.follows and not row.next.follows:
        _take_over(memory, facts)
    if row.next is Phase.HOLDING:
        memory.takeovers += 1
    elif row.next is Phase.SINKING:
        memory.cause = said
        memory.descent_limit = _descent_limit(memory, facts)
        if row is CONTROL_STAYS_AWAY and not facts.may_lack_reference:
            facts.controller_failed = facts.ran
    elif row.next.is_off:
        facts.end_flight()
    memory.reason = row.says.format(said, cause=memory.cause)


def _take_over(memory, facts):
    # States stop before controls do, so the last state is used.
    motion = facts.measured.within(facts.now, LAST_STATE)
    age = facts.measured.age(facts.now)
    flown = _passed(memory, facts)
    memory.fallback = SafeControl(facts.hover, motion, age, flown)
    memory.own_at = facts.now
    facts.flown = None
    facts.ground.begin_descent()


def _descent_limit(memory, facts):
    # If the motors stop too early, the vehicle falls; too late does no harm.
    motion = facts.seen or memory.fallback.begin
    longer = 0.0 if motion is None else descent_time(motion, facts.ground.z)
    return facts.timeouts.descent + longer


# The nominal case.


def is_on_ground(memory: Memory, facts: Facts) -> bool:
    """Return whether nothing shows that the vehicle is off the ground, or its motors are off."""
    return memory.phase.is_off or (memory.phase.follows and facts.stands)


def takeoff_refusal(memory: Memory, facts: Facts) -> str:
    """Return why the supervisor passes no takeoff on; empty if it does."""
    stays = is_on_ground(memory, facts) and memory.phase is not Phase.EMERGENCY
    return facts.contention if stays else ""


def may_look_rarely(memory: Memory, facts: Facts) -> bool:
    """Return whether no guard can fire within half of the timeout ``hold``."""
    half = 0.5 * facts.hold
    lifts_off = not facts.needs_controller and facts.takeoff_age < half
    is_heard = facts.silence < half or lifts_off or facts.stands
    is_settled = memory.phase in (Phase.ON_GROUND, Phase.PASSING)
    return is_settled and is_heard and not (facts.is_tilted or facts.outside)


def _is_clear(memory, facts):
    """Return whether no guard can fire before the next look: the state says when one might."""
    if not (facts.now < memory.clear_until and facts.silence < 0.5 * facts.hold):
        return False
    vehicle = facts.vehicle
    has_fault = vehicle is not None and vehicle.flight_fault(facts.now, memory.flight_begun)
    return facts.is_free and not has_fault


def _is_nominal(memory, facts):
    if memory.phase is not Phase.PASSING or memory.firing or not facts.is_commanded:
        return False
    # In the climb of a takeoff, the controller is selected when the server has become silent.
    is_flown = facts.flight in (FlightState.FLYING, FlightState.TAKING_OFF)
    is_heard = facts.silence < 0.5 * facts.hold
    return is_flown and is_heard and facts.needs_controller and facts.is_free


# Controls.


def _is_refused(memory, facts):
    return facts.takeoff.setpoint.thrust > 0.0 and bool(takeoff_refusal(memory, facts))


def _keep_takeoff(memory, facts):
    """Note a takeoff control that counts: a refused one never does, not even later."""
    is_zero = facts.takeoff.setpoint.thrust <= 0.0
    is_contended = facts.contention and not (is_zero and is_on_ground(memory, facts))
    is_ended = memory.phase is Phase.SINKING or (memory.phase is Phase.EMERGENCY and not is_zero)
    if not (is_contended or is_ended):
        facts.kept, facts.flown = replace(facts.takeoff), None


def _pass_takeoff(memory, facts):
    if _is_refused(memory, facts):
        return MOTORS_OFF
    if not memory.phase.follows:
        return None
    return _takeoff_control(memory, facts, facts.takeoff)


def _takeoff_control(memory, facts, heard):
    """Return a takeoff control, or what is left of it within the limits."""
    memory.takeoff = _limited(facts, heard.setpoint, 0.0, is_ramp=True)
    _learn_from(facts, memory.takeoff)
    return heard.control if memory.takeoff == heard.setpoint else memory.takeoff


def _pass_commanded(memory, facts):
    if not memory.phase.follows or memory.phase is Phase.LISTENING:
        return None
    if not facts.in_flight:
        # Thrust above zero comes from a server that takes off without a flight state; the known
        # flight state is outdated then.
        is_kept_down = facts.flight is FlightState.ON_GROUND and facts.kept_thrust <= 0.0
        if is_kept_down or facts.takeoff_age <= TAKEOFF_CONTROL_LIMIT:
            return _late_takeoff(memory, facts) or _kept(memory, facts)
    late = max(facts.commanded.age, facts.silence)
    if late > facts.hold:
        return None
    setpoint = facts.commanded.setpoint
    allowed = _limited(facts, setpoint, MIN_THRUST if facts.in_flight else 0.0)
    if memory.phase is Phase.RETURNING:
        memory.passed = memory.own.mixed(allowed, memory.elapsed(facts) / RETURN_TIME)
        return memory.passed
    memory.passed = allowed
    facts.flown = None if facts.stands else allowed
    if late > 0.5 * facts.hold:
        return _faded(facts, allowed, late)
    return facts.commanded.control if allowed == setpoint else allowed


def _kept(memory, facts):
    kept = facts.kept
    return None if kept.setpoint is None else _takeoff_control(memory, facts, kept)


def _limited(facts, setpoint, lowest, is_ramp=False):
    motion, hover = facts.seen, facts.hover
    control = facts.limits.in_range(setpoint, lowest)
    climb, lands = facts.limits.climb, facts.lands
    if lands:
        climb = LANDING_CLIMB
    elif is_ramp and facts.flight is FlightState.LANDING:
        # No ramp of a landing lifts the vehicle; a restarted server assumes that it hovers at g.
        control = control._replace(thrust=min(control.thrust, hover))
        climb, lands = 0.0, True
    elif is_ramp:
        climb = min(climb, TAKEOFF_CLIMB)
    thrust, excess = within_climb(control.thrust, hover, motion, facts.highest, climb)
    facts.climb_excess = "" if lands else excess
    z_dot = 0.0 if motion is None else motion.velocity[2]
    return within_pause(
        control._replace(thrust=thrust), facts.pauses.longest, hover, z_dot, is_ramp
    )


def _substitute(memory, facts):
    """Return a control of the supervisor's own, or None."""
    if memory.phase in (Phase.HOLDING, Phase.SINKING):
        return _fly(memory, facts)
    if memory.phase.is_off:
        return MOTORS_OFF
    if memory.phase is Phase.LISTENING:
        return None
    half = 0.5 * facts.hold
    if facts.needs_controller:
        is_busy = facts.pauses.longest > facts.hold
        if memory.phase is Phase.RETURNING and is_busy:
            # Whoever seldom runs cannot rely on the next control to complete the change.
            memory.passed = _fly(memory, facts).mixed(
                facts.commanded.setpoint, memory.elapsed(facts) / RETURN_TIME
            )
            return memory.passed
        is_late = facts.silence > half and memory.passed is not None
        return _faded(facts, _passed(memory, facts), facts.silence) if is_late else None
    keeps_up = facts.takeoff_age <= TAKEOFF_CONTROL_LIMIT and not facts.stands
    return _late_takeoff(memory, facts) if keeps_up and not facts.in_flight else None


def _fly(memory, facts):
    step_, memory.own_at = min(max(facts.now - memory.own_at, 0.0), LAST_STATE), facts.now
    own = memory.fallback.advance(step_, facts.seen, memory.phase is Phase.SINKING)
    if facts.seen is None and facts.learned_for < LEARNING_TIME:
        is_guess = facts.learned_for < GUESS_TIME
        most = UNSEEN_THRUST if is_guess else LEARNING_SHARE * facts.hover
        own = own._replace(thrust=min(own.thrust, most))
    own = within_pause(own, facts.pauses.longest, facts.hover, memory.fallback.climb)
    memory.own = own._replace(thrust=min(own.thrust, MAX_SUBSTITUTE))
    facts.ground.advance(step_, facts.seen, memory.own.thrust / facts.hover)
    return memory.own


def _late_takeoff(memory, facts):
    """Return the control that replaces the last takeoff control; None if it is not late.

    Less thrust than that of hover belongs to a ramp, which goes on.
    """
    age = facts.takeoff_age
    is_late = 0.5 * facts.hold < age < math.inf and memory.takeoff.thrust > facts.hover
    if not is_late:
        return None
    faded = _faded(facts, memory.takeoff, age)
    _learn_from(facts, faded)
    return faded


def _learn_from(facts, control):
    """Learn from a control of a takeoff: its server may end before it has said the weight."""
    is_seen = facts.flight is FlightState.TAKING_OFF and facts.seen is not None
    facts.flown = control if is_seen else None


def _faded(facts, setpoint, age):
    """Return a control ``age`` s ago: unchanged for half of ``hold``, level hover from it on."""
    weight = min(max(age / (0.5 * facts.hold) - 1.0, 0.0), 1.0)
    return setpoint.mixed(SafeSetpoint(0.0, 0.0, 0.0, facts.hover), weight)


def _passed(memory, facts):
    """Return the last control that has passed; level hover before the first commanded one."""
    control = memory.passed
    if control is None:
        return SafeSetpoint(0.0, 0.0, 0.0, facts.hover)
    return SafeSetpoint(control.roll, control.pitch, control.yaw_dot, control.thrust)


def reset(memory: Memory, facts: Facts) -> None:
    """Allow the next takeoff after an emergency.

    `RefusalError`: there is no emergency, or the vehicle may not be on the ground yet.
    """
    if memory.phase is not Phase.EMERGENCY:
        raise RefusalError("there is no emergency")
    if memory.elapsed(facts) < RESET_DELAY:
        raise RefusalError(
            f"the motors were stopped less than {RESET_DELAY:g} s ago; see that the vehicle is at "
            "rest on the ground"
        )
    facts.emergency, facts.is_reset = "", True
    judge(memory, facts)
    facts.is_reset = False
