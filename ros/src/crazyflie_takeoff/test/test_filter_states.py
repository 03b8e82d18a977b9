"""The table of the filter's states, walked at random."""

from random import Random

import pytest
from filter_flight import LIMITS
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_msgs.msg import FilterStatus
from crazyflie_takeoff.filter_machine import FilterEvent, FilterMachine, FilterState, LossTimeouts
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import SafeSetpoint
from crazyflie_takeoff.transition_table import FlightState

TABLE = FilterMachine.TABLE
LEGAL = {
    FilterState.SINKING: {FilterState.DOWN, FilterState.EMERGENCY},
    FilterState.DOWN: {FilterState.PASSING, FilterState.EMERGENCY},
    FilterState.EMERGENCY: {FilterState.DOWN},
}
"""States that no control ends, and what follows them."""


class World:
    """A machine whose facts change at random."""

    def __init__(self):
        self.machine = FilterMachine(LossTimeouts(0.125, 1.5, 5.0, 3.0), LIMITS)
        self.measured = self.machine.relay.measured

    def change(self, random):
        """Advance the time, and change facts."""
        step = random.choice([0.01, 0.01, 1.0, 3.0, 9.0])
        self.machine.elapsed += step
        self.machine.silence = random.choice([0.0, 0.2])
        self.machine.is_needed = random.random() < 0.7
        self.machine.takeoff_thrust = random.choice([0.0, 9.0, 10.0])
        self.measured.age += step
        if random.random() < 0.5:
            position = (0.0, 0.0, random.choice([0.0, 0.07, 1.0]))
            self.measured.update(Motion(position, (0.0, 0.0, random.choice([-0.4, 0.0]))), 0.0)
        if random.random() < 0.3:
            self.machine.flight_state = random.choice([None, *FlightState])
        if random.random() < 0.1:
            self.machine.toggle()
        if random.random() < 0.1:
            thrust = self.machine.takeoff_thrust
            self.machine.takeoff(0.0, "control", SafeSetpoint(0.0, 0.0, 0.0, thrust))

    def facts(self):
        """Return all that guards could change."""
        relay = self.machine.relay
        parts = (self.machine, relay, relay.measured, relay.ground)
        return [vars(part).copy() for part in parts]

    def rows(self, event):
        """Return the rows of which any could be taken."""
        machine = self.machine
        return [
            row
            for row in TABLE
            if row.state is machine.state and row.event is event
            if row.guard is None or row.guard(machine)
        ]


@given(st.integers(0))
def test_whatever_happens_the_table_decides(seed):
    random, world = Random(seed), World()
    machine = world.machine
    for _ in range(50):
        world.change(random)
        event = random.choice(list(FilterEvent))
        before = world.facts()
        rows = world.rows(event)
        # Guards change nothing, and all that hold lead to the same state.
        assert world.facts() == before
        assert len({row.next for row in rows}) <= 1
        state = machine.state
        assert machine.handle(event, "an event") == bool(rows)
        assert machine.state is (rows[0].next if rows else state)
        if machine.state is not state:
            assert machine.elapsed == 0.0
            assert machine.state in LEGAL.get(state, FilterState)
        if state is FilterState.EMERGENCY and event is not FilterEvent.RESET:
            assert machine.state is FilterState.EMERGENCY
        if machine.state in (FilterState.DOWN, FilterState.EMERGENCY):
            assert machine.is_on_ground
        if machine.state is not FilterState.PASSING:
            assert machine.reason


@pytest.mark.parametrize(
    ("state", "event", "facts", "after"),
    [
        (FilterState.PASSING, FilterEvent.TICK, {"silence": 0.125}, FilterState.PASSING),
        (FilterState.PASSING, FilterEvent.TICK, {"silence": 0.14}, FilterState.HOLDING),
        (FilterState.HOLDING, FilterEvent.TICK, {"elapsed": 3.0}, FilterState.HOLDING),
        (FilterState.HOLDING, FilterEvent.TICK, {"elapsed": 3.1}, FilterState.SINKING),
        (FilterState.HOLDING, FilterEvent.TICK, {"elapsed": 2.0, "age": 1.5}, FilterState.HOLDING),
        (FilterState.HOLDING, FilterEvent.TICK, {"elapsed": 2.0, "age": 1.6}, FilterState.SINKING),
        (FilterState.EMERGENCY, FilterEvent.RESET, {"elapsed": 1.9}, FilterState.EMERGENCY),
        (FilterState.EMERGENCY, FilterEvent.RESET, {"elapsed": 2.0}, FilterState.DOWN),
    ],
)
def test_how_long_the_filter_waits(state, event, facts, after):
    world = World()
    machine, age = world.machine, facts.pop("age", 0.0)
    machine.flight_state = FlightState.FLYING
    world.measured.update(Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), age)
    machine.state, machine.is_needed = state, True
    vars(machine).update(facts)
    machine.handle(event)
    assert machine.state is after
    assert machine.takeovers == (after is FilterState.HOLDING is not state)


@pytest.mark.parametrize("may_lack_reference", [True, False])
def test_a_controller_that_does_not_answer_is_missing(may_lack_reference):
    machine = World().machine
    machine.state, machine.is_needed = FilterState.HOLDING, True
    machine.elapsed, machine.may_lack_reference = 9.0, may_lack_reference
    assert machine.handle(FilterEvent.TICK)
    assert machine.lacks_controller == (not may_lack_reference)


def test_each_row_can_be_taken():
    random, taken = Random(1), set()
    for _ in range(500):
        world = World()
        for _ in range(30):
            world.change(random)
            event = random.choice(list(FilterEvent))
            taken.update(TABLE.index(row) for row in world.rows(event)[:1])
            world.machine.handle(event)
    assert taken == set(range(len(TABLE)))


def test_each_state_has_an_exit_and_an_entry():
    exits = {row.state for row in TABLE if row.next is not row.state}
    entries = {row.next for row in TABLE if row.next is not row.state}
    assert exits == entries == set(FilterState)


def test_an_emergency_comes_from_every_state():
    stopped = {row.state for row in TABLE if row.event is FilterEvent.STOP and row.guard is None}
    assert stopped == set(FilterState) - {FilterState.EMERGENCY}


def test_no_control_ends_a_descent():
    ends = {row.next for row in TABLE if row.state is FilterState.SINKING}
    assert FilterState.SINKING.passes_nothing
    assert FilterState.PASSING not in ends


def test_states_are_those_of_the_message():
    assert {each.name: each.value for each in FilterState} == {
        name: getattr(FilterStatus, name) for name in FilterState.__members__
    }
