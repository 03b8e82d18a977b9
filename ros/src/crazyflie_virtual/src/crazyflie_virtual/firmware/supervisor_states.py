"""The supervisor's states and the transitions between them, as a table.

As in the firmware: docs/functional-areas/supervisor of crazyflie-firmware explains
the scheme. States, conditions and their order are those of its
supervisor_state_machine.c (the last version we could read is of 2024) with what
came later: that disarming in the air is no emergency (pull request 1426), that an
arming has a time limit (1441), and the state before `State.READY_TO_FLY`
(1641). The recorded flights (release 2026.08) confirm each transition but these, of
which there is no record: the one out of `State.READY_TO_FLY` by time, those out of
`State.LANDED` by disarming and of `State.WARNING_LEVEL_OUT` by disarming and tumbling, and
those of `State.CRASHED`.
"""

from enum import Enum, Flag, auto
from typing import NamedTuple


class State(Enum):
    """States of the supervisor; names as the firmware's supervisorState_t, texts as it prints."""

    PRE_FL_CHECKS_NOT_PASSED = "Pre-flight checks not passed"
    PRE_FL_CHECKS_PASSED = "Pre-flight checks passed"
    ARMING = "Arming"
    READY_TO_FLY = "Ready to fly"
    FLYING = "Flying"
    LANDED = "Landed"
    RESET = "Reset"
    WARNING_LEVEL_OUT = "Warning, level out"
    EXCEPT_FREE_FALL = "Exception, free fall"
    CRASHED = "Crashed"
    LOCKED = "Locked"


class Condition(Flag):
    """Conditions of transitions; names as the firmware's SUPERVISOR_CB."""

    ARMED = auto()
    IS_FLYING = auto()  #: Some motor ran within the last 2 s.
    IS_TUMBLED = auto()
    COMMANDER_WDT_WARNING = auto()  #: The setpoint is older than 0.5 s.
    COMMANDER_WDT_TIMEOUT = auto()  #: The setpoint is older than 2 s.
    EMERGENCY_STOP = auto()
    CRASHED = auto()  #: Not recovered since the crash.
    PREFLIGHT_TIMEOUT = auto()  #: Armed for `Supervisor.preflight_timeout`.
    LANDING_TIMEOUT = auto()  #: Landed for `Supervisor.landed_timeout`.
    ALWAYS = auto()


class Transition(NamedTuple):
    """Taken when any condition of ``when`` holds, or any of ``unless`` does not."""

    to: State
    when: Condition = Condition(0)
    unless: Condition = Condition(0)


_S, _C = State, Condition

#: The first transition whose condition is met is taken, one in each update.
TRANSITIONS: dict[State, tuple[Transition, ...]] = {
    _S.PRE_FL_CHECKS_NOT_PASSED: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(_S.PRE_FL_CHECKS_PASSED, unless=_C.IS_TUMBLED),
    ),
    _S.PRE_FL_CHECKS_PASSED: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.IS_TUMBLED),
        Transition(_S.ARMING, when=_C.ARMED),
    ),
    _S.ARMING: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.IS_TUMBLED, unless=_C.ARMED),
        # Brushless vehicles with motor telemetry wait for it in this state.
        Transition(_S.READY_TO_FLY, when=_C.ALWAYS),
    ),
    _S.READY_TO_FLY: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.EMERGENCY_STOP),
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.IS_TUMBLED, unless=_C.ARMED),
        Transition(_S.FLYING, when=_C.IS_FLYING),
        Transition(_S.PRE_FL_CHECKS_PASSED, when=_C.PREFLIGHT_TIMEOUT),
    ),
    _S.FLYING: (
        Transition(_S.EXCEPT_FREE_FALL, when=_C.COMMANDER_WDT_TIMEOUT | _C.EMERGENCY_STOP),
        Transition(_S.CRASHED, when=_C.IS_TUMBLED),
        Transition(_S.RESET, unless=_C.ARMED),
        Transition(_S.WARNING_LEVEL_OUT, when=_C.COMMANDER_WDT_WARNING),
        Transition(_S.LANDED, unless=_C.IS_FLYING),
    ),
    _S.LANDED: (
        Transition(_S.RESET, when=_C.LANDING_TIMEOUT, unless=_C.ARMED),
        Transition(_S.FLYING, when=_C.IS_FLYING),
    ),
    _S.RESET: (Transition(_S.PRE_FL_CHECKS_NOT_PASSED, when=_C.ALWAYS),),
    # No transition to LANDED: without setpoints a vehicle is locked although its motors are off.
    _S.WARNING_LEVEL_OUT: (
        Transition(
            _S.EXCEPT_FREE_FALL, when=_C.COMMANDER_WDT_TIMEOUT | _C.IS_TUMBLED | _C.EMERGENCY_STOP
        ),
        Transition(_S.RESET, unless=_C.ARMED),
        Transition(_S.FLYING, unless=_C.COMMANDER_WDT_WARNING),
    ),
    _S.EXCEPT_FREE_FALL: (Transition(_S.LOCKED, when=_C.ALWAYS),),
    _S.CRASHED: (
        Transition(_S.PRE_FL_CHECKS_NOT_PASSED, unless=_C.CRASHED),
        Transition(_S.LOCKED, when=_C.EMERGENCY_STOP),
    ),
    _S.LOCKED: (),
}


def next_state(state: State, conditions: Condition) -> State:
    """Return the state after one update."""
    for transition in TRANSITIONS[state]:
        if conditions & transition.when or ~conditions & transition.unless:
            return transition.to
    return state
