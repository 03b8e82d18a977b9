"""The supervisor's states and the transitions between them, as a table.

As in the firmware: docs/functional-areas/supervisor of crazyflie-firmware explains
the scheme. States, conditions and their order are those of its
supervisor_state_machine.c (the last version we could read is of 2024) with what
came later: that disarming in the air is no emergency (pull request 1426), that an
armed vehicle does not wait for ever (1441), and the state before `State.READY`
(1641). The recorded flights (release 2026.08) confirm each transition but these, of
which there is no record: the one out of `State.READY` by time, those out of
`State.LANDED` by disarming and of `State.LEVELLING` by disarming and tumbling, and
those of `State.CRASHED`.
"""

from enum import Enum, Flag, auto
from typing import NamedTuple


class State(Enum):
    """Where the supervisor is."""

    NOT_READY = "Pre-flight checks not passed"
    CHECKED = "Pre-flight checks passed"
    ARMING = "Arming"
    READY = "Ready to fly"
    FLYING = "Flying"
    LANDED = "Landed"
    RESET = "Reset"
    LEVELLING = "Warning, level out"
    FREE_FALL = "Exception, free fall"
    CRASHED = "Crashed"
    LOCKED = "Locked"


class Condition(Flag):
    """What decides on transitions."""

    ARMED = auto()
    FLYING = auto()
    """Some motor ran within the last 2 s."""
    TUMBLED = auto()
    SETPOINT_OLD = auto()
    """For more than 0.5 s."""
    SETPOINT_TOO_OLD = auto()
    """For more than 2 s."""
    EMERGENCY = auto()
    CRASHED = auto()
    """Not recovered since the crash."""
    NOT_TAKEN_OFF = auto()
    """Armed for `Supervisor.preflight_timeout`."""
    NOT_FLOWN_AGAIN = auto()
    """Landed for `Supervisor.landed_timeout`."""
    ALWAYS = auto()


class Transition(NamedTuple):
    """Taken when any condition of ``when`` holds, or any of ``unless`` does not."""

    to: State
    when: Condition = Condition(0)
    unless: Condition = Condition(0)


_S, _C = State, Condition

TRANSITIONS: dict[State, tuple[Transition, ...]] = {
    _S.NOT_READY: (
        Transition(_S.FREE_FALL, when=_C.EMERGENCY),
        Transition(_S.CHECKED, unless=_C.TUMBLED),
    ),
    _S.CHECKED: (
        Transition(_S.FREE_FALL, when=_C.EMERGENCY),
        Transition(_S.NOT_READY, when=_C.TUMBLED),
        Transition(_S.ARMING, when=_C.ARMED),
    ),
    _S.ARMING: (
        Transition(_S.FREE_FALL, when=_C.EMERGENCY),
        Transition(_S.NOT_READY, when=_C.TUMBLED, unless=_C.ARMED),
        # Brushless vehicles with telegrams from their motors wait for these here.
        Transition(_S.READY, when=_C.ALWAYS),
    ),
    _S.READY: (
        Transition(_S.FREE_FALL, when=_C.EMERGENCY),
        Transition(_S.NOT_READY, when=_C.TUMBLED, unless=_C.ARMED),
        Transition(_S.FLYING, when=_C.FLYING),
        Transition(_S.CHECKED, when=_C.NOT_TAKEN_OFF),
    ),
    _S.FLYING: (
        Transition(_S.FREE_FALL, when=_C.SETPOINT_TOO_OLD | _C.EMERGENCY),
        Transition(_S.CRASHED, when=_C.TUMBLED),
        Transition(_S.RESET, unless=_C.ARMED),
        Transition(_S.LEVELLING, when=_C.SETPOINT_OLD),
        Transition(_S.LANDED, unless=_C.FLYING),
    ),
    _S.LANDED: (
        Transition(_S.RESET, when=_C.NOT_FLOWN_AGAIN, unless=_C.ARMED),
        Transition(_S.FLYING, when=_C.FLYING),
    ),
    _S.RESET: (Transition(_S.NOT_READY, when=_C.ALWAYS),),
    # There is no way from here to LANDED: with its motors off, too, a vehicle
    # that gets no setpoints is locked.
    _S.LEVELLING: (
        Transition(_S.FREE_FALL, when=_C.SETPOINT_TOO_OLD | _C.TUMBLED | _C.EMERGENCY),
        Transition(_S.RESET, unless=_C.ARMED),
        Transition(_S.FLYING, unless=_C.SETPOINT_OLD),
    ),
    _S.FREE_FALL: (Transition(_S.LOCKED, when=_C.ALWAYS),),
    _S.CRASHED: (
        Transition(_S.NOT_READY, unless=_C.CRASHED),
        Transition(_S.LOCKED, when=_C.EMERGENCY),
    ),
    _S.LOCKED: (),
}
"""The first transition whose condition is met is taken, one in each update."""


def next_state(state: State, conditions: Condition) -> State:
    """Return the state after one update."""
    for transition in TRANSITIONS[state]:
        if conditions & transition.when or ~conditions & transition.unless:
            return transition.to
    return state
