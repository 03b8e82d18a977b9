"""The states of a flight, and state machines as data: the program runs the table that is drawn.

A table is a sequence of `Transition`; guards and actions are functions of one context, and their
names are the words of the diagram.
"""

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar


class FlightState(enum.IntEnum):
    """State of a flight; the values are those of crazyflie_msgs/FlightStatus.

    A landing has two states, because the vehicle is still in flight in the first: the controller
    brings it down (`DESCENDING`) before the server ramps the thrust down (`LANDING`).
    """

    ON_GROUND = 1
    TAKING_OFF = 2
    FLYING = 3
    DESCENDING = 4
    LANDING = 5

    @property
    def word(self) -> str:
        """The name of the state on text topics."""
        return self.name.lower()

    @cached_property
    def in_flight(self) -> bool:
        """Whether the controller flies the vehicle: the value that the topic in_flight toggles."""
        return self in (FlightState.FLYING, FlightState.DESCENDING)


def flight_state(code: int) -> FlightState | None:
    """Return the state of a constant of FlightStatus; None for UNKNOWN, else ValueError."""
    return FlightState(code) if code else None


State = TypeVar("State", bound=enum.Enum)
Context = TypeVar("Context")


@dataclass(frozen=True)
class Transition(Generic[State, Context]):
    """A row of a table: in a state, at an event, if the guard holds."""

    state: State
    event: enum.Enum
    guard: Callable[[Context], bool] | None  # Has no side effects; None: always true.
    next: State  # May be the same.
    action: Callable[[Context], object] | None = None  # Called before the state changes.


Table = Sequence[Transition[State, Context]]


def find(
    table: Table[State, Context], state: State, event: enum.Enum, context: Context
) -> Transition[State, Context] | None:
    """Return the first row of a table for a state and an event whose guard holds, or None."""
    for row in table:
        if row.state is state and row.event is event and (row.guard is None or row.guard(context)):
            return row
    return None


def step(table: Table[State, Context], state: State, event: enum.Enum, context: Context) -> State:
    """Call the action of the row that `find` returns; return the next state.

    Without such a row the event is ignored: the state stays.
    """
    row = find(table, state, event, context)
    if row is None:
        return state
    if row.action is not None:
        row.action(context)
    return row.next


def words(function: Callable[..., object] | None) -> str:
    """Return the name of a guard or an action in words; empty for None."""
    return "" if function is None else function.__name__.strip("_").replace("_", " ")
