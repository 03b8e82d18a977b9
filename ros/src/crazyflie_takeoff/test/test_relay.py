"""Controls as passed on: late ones, those of a landing, and the hover that is learned from them."""

from random import Random

import pytest
from filter_flight import (
    DESCENDING,
    FLYING,
    LANDING,
    LIMITS,
    ON_GROUND,
    TAKING_OFF,
    TIMEOUTS,
    G,
    level,
)
from hypothesis import example, given
from hypothesis import strategies as st

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_takeoff.filter_machine import FilterMachine, FilterState
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.relay import Relay
from crazyflie_takeoff.safe_control import SafeSetpoint
from crazyflie_takeoff.transition_table import FlightState

TILTED = SafeSetpoint(0.2, -0.1, 1.0, G + 0.5)
HALF = pytest.approx((0.1, -0.05, 0.5, G + 0.25))


@pytest.fixture
def relay():
    """Return a relay whose controls fade from 0.125 s to 0.25 s."""
    return Relay(LIMITS, 0.25)


def command(relay, setpoint, time=1.0, age=0.0, learns=False, in_flight=True):
    relay.command(setpoint)
    return relay.commanded(time, "control", age, in_flight, learns=learns)


def at(z):
    return Motion((0.0, 0.0, z), (0.0, 0.0, 0.0))


def test_a_control_that_is_late_fades_to_level_hover(relay):
    assert relay.passed == level(G)
    assert relay.late(9.0) is None
    assert command(relay, TILTED) == "control"
    assert relay.passed == TILTED
    fading = [relay.late(silence) for silence in (0.125, 0.1875, 0.25, 9.0)]
    assert fading == [None, HALF, level(G), level(G)]
    assert relay.late(0.13) is not None


def test_a_control_that_is_made_of_old_data_fades_too(relay):
    passed = [command(relay, TILTED, age=age) for age in (0.125, 0.1875, 0.25)]
    assert passed == ["control", HALF, level(G)]
    assert command(relay, TILTED, age=0.13) != "control"


def test_a_takeoff_control_that_is_late_fades(relay):
    assert relay.takeoff("lift", TILTED, lands=False) == "lift"
    fading = [relay.late_takeoff(age) for age in (0.125, 0.1875, 0.25, 0.5)]
    assert fading == [None, HALF, level(G), level(G)]
    assert relay.late_takeoff(0.13) is not None
    # Less than hover is of a ramp, which goes on.
    relay.takeoff("ramp", level(G), lands=False)
    assert relay.late_takeoff(0.25) is None


@pytest.mark.parametrize(
    ("state", "thrust", "age", "fades"),
    [
        (TAKING_OFF, G + 0.5, 0.5, True),
        (TAKING_OFF, G + 0.5, 0.51, False),
        (TAKING_OFF, G + 0.5, 0.04, False),
        (FLYING, G + 0.5, 0.3, False),
        (ON_GROUND, 0.0, 0.3, False),
    ],
)
def test_the_last_takeoff_control_of_a_vehicle_in_the_air_fades_for_half_a_second(
    state, thrust, age, fades
):
    machine = FilterMachine(TIMEOUTS, LIMITS)
    machine.stop_listening(0.0)
    machine.flight_state = state
    for k in range(100):
        machine.takeoff(0.01 * k, "lift", level(thrust))
        machine.tick(0.01 * k)
    machine.commanded(1.0, "control", level(G))
    control = machine.tick(0.99 + age)
    # In flight, the controller's comes first.
    assert (control is not None and control.thrust < thrust) == fades
    if state is TAKING_OFF and age <= 0.5:
        repeated = machine.commanded(0.99 + age, "control", level(G))
        assert repeated == (control if fades else "lift")


@pytest.mark.parametrize(
    ("step", "learns", "learned"),
    [(0.1875, True, 0.1875 / 2.1875), (0.25, True, 0.0), (0.125, False, 0.0), (-0.5, True, 0.0)],
)
def test_hover_is_learned_from_controls_that_follow_each_other_in_flight(
    relay, step, learns, learned
):
    for time in (1.0, 1.0 + step):
        command(relay, level(G + 1.0), time, learns=learns)
    assert relay.hover - G == pytest.approx(learned)


def test_what_a_vehicle_accelerates_by_is_not_learned(relay):
    for time, z_dot in ((1.0, 0.0), (1.125, 0.0), (1.25, 0.125)):
        relay.measure(Motion((0.0, 0.0, 1.0), (9.0, 9.0, z_dot)), 0.0, False, True)
        command(relay, level(G + 1.0), time, learns=True)
    thrust = 1.0 - (2.0 / 2.125) ** 2
    assert relay.hover - G == pytest.approx(thrust - 0.125 * (2.0 / 2.125) / 2.0)


def test_what_happens_while_the_filter_does_not_run_is_not_learned(relay):
    for tick in range(300):
        relay.measure(at(1.0), 0.0, False, True)
        command(relay, level(G), tick / 100, learns=True)
    # It climbs, and then falls: its motors stop 2 s after the last control.
    relay.measure(at(4.0)._replace(velocity=(0.0, 0.0, -5.0)), 0.0, False, True)
    command(relay, level(16.0), 5.0, learns=True)
    assert relay.hover == pytest.approx(G)
    command(relay, level(G), 5.01, learns=True)
    assert relay.hover == pytest.approx(G)


def test_without_a_state_a_vehicle_neither_climbs_nor_falls(relay):
    relay.gaps.run(1.0)
    relay.gaps.run(1.25)
    # 0.5 m/s within the gap.
    assert command(relay, level(G + 9.0)).thrust - G == pytest.approx(2.0)


@pytest.mark.parametrize(("in_flight", "least"), [(True, MIN_THRUST), (False, 0.0)])
def test_the_least_thrust_of_a_control(relay, in_flight, least):
    assert command(relay, level(-3.0), in_flight=in_flight) == level(least)
    assert relay.takeoff("ramp", level(-3.0), lands=False) == level(0.0)


@pytest.mark.parametrize(
    ("state", "z", "age", "objects"),
    [
        (DESCENDING, 1.0, 0.0, True),
        (DESCENDING, 0.25, 0.0, False),
        (DESCENDING, 1.0, 0.3, False),
        (FLYING, 1.0, 0.0, False),
        (LANDING, 1.0, 0.0, False),
    ],
)
def test_only_a_landing_that_is_seen_above_the_ground_must_come_down(state, z, age, objects):
    machine = FilterMachine(TIMEOUTS, LIMITS)
    machine.takeoff(0.0, "zero", level(0.0))
    machine.measure(at(0.25))
    machine.flight_state = state
    for k in range(250):
        machine.measure(at(z), age)
        machine.commanded(0.01 * k, "control", level(G))
        machine.tick(0.01 * k)
    assert (machine.state is FilterState.SINKING) == objects


# The short way.

#: Tolerance of the thrust of hover (m/s^2), which is learned from the mean of the controls between
#: two ticks.
TOLERANCE = 0.002


def flying(z=1.0, state=FLYING):
    """Return a machine whose nominal flight, or climb, has lasted for a second."""
    machine = FilterMachine(TIMEOUTS, LIMITS)
    machine.stop_listening(0.0)
    machine.flight_state = state
    for k in range(-100 if state is TAKING_OFF else 0, 101):
        if k < -60:
            machine.takeoff(0.01 * k, "thrust", level(G + 0.2), "server")
        machine.measure(at(z))
        machine.commanded(0.01 * k, "control", level(G))
        machine.tick(0.01 * k)
    return machine


@pytest.mark.parametrize("state", [FLYING, TAKING_OFF])
def test_a_nominal_control_passes_unchanged(state):
    machine = flying(state=state)
    assert machine.pass_unchanged(1.01, level(G), 0.0)
    assert machine.pass_unchanged(
        1.02, SafeSetpoint(MAX_TILT, -MAX_TILT, MAX_YAW_RATE, MAX_THRUST), 0
    )
    assert machine.pass_unchanged(1.03, level(MIN_THRUST), 0.04)
    assert not machine.pass_unchanged(1.04, level(MIN_THRUST), 0.05)
    # Until the filter has to run again.
    assert machine.pass_unchanged(1.049, level(MIN_THRUST), 0.0)
    assert not machine.pass_unchanged(1.06, level(MIN_THRUST), 0.0)
    assert not machine.pass_unchanged(0.99, level(MIN_THRUST), 0.0)


@pytest.mark.parametrize(
    "control",
    [
        SafeSetpoint(0.27, 0.0, 0.0, G),
        SafeSetpoint(0.0, -0.27, 0.0, G),
        SafeSetpoint(0.0, 0.0, -3.5, G),
        level(16.1),
        level(3.9),
    ],
)
def test_a_control_that_is_out_of_range_takes_the_long_way(control):
    assert not flying().pass_unchanged(1.01, control, 0.0)


@pytest.mark.parametrize(
    "event",
    [
        lambda machine: machine.stop("it was called"),
        lambda machine: machine.toggle(),
        lambda machine: machine.set_tilted(True),
        lambda machine: machine.miss_server(),
        lambda machine: machine.measure(at(9.0)),
        lambda machine: machine.measure(Motion((0.0, 0.0, 1.0), (0.0, 0.0, 2.2))),
        lambda machine: machine.takeoff(1.01, "zero", level(0.0), "server"),
        lambda machine: machine.commanded(1.01, "other", level(G), "other"),
        lambda machine: setattr(machine, "flight_state", DESCENDING),
    ],
)
def test_whatever_happens_ends_the_short_way_until_the_next_tick(event):
    machine = flying()
    event(machine)
    assert not machine.pass_unchanged(1.01, level(G), 0.0)


@pytest.mark.parametrize(
    ("z", "z_dot", "passes"),
    [(1.0, 2.1, True), (1.0, 2.2, False), (2.0, 0.0, True), (2.2, 0.0, False)],
)
def test_a_fast_or_high_climb_takes_the_long_way(z, z_dot, passes):
    machine = flying()
    # The wall is at 3 m; 0.25 m above it, and 3 m/s end within 1.125 m.
    machine.measure(Motion((0.0, 0.0, z), (0.0, 0.0, z_dot)))
    machine.commanded(1.01, "control", level(G))
    machine.tick(1.01)
    assert machine.pass_unchanged(1.02, level(G), 0.0) == passes


@given(st.integers(0), st.sampled_from([FLYING, TAKING_OFF]))
# Controls between two ticks, none of them late.
@example(seed=25264160, state=TAKING_OFF)
def test_the_short_way_leads_where_the_long_one_does(seed, state):
    """Random flights of two filters, one of which never takes it."""
    random, short, long = Random(seed), flying(state=state), flying(state=state)
    time, taken = 1.0, 0
    motion = at(1.0)
    for k in range(400):
        time += random.choice([0.01, 0.01, 0.01, 0.002, 0.03])
        thrust = random.gauss(G + 0.5, 1.0 if random.random() < 0.9 else 5.0)
        control = SafeSetpoint(random.gauss(0.0, 0.05), random.gauss(0.0, 0.1), 0.1, thrust)
        age = random.choice([0.0, 0.0, 0.0, 0.01, 0.06])
        if random.random() < 0.95:
            if short.pass_unchanged(time, control, age):
                passed, taken = control, taken + 1
            else:
                passed = short.commanded(time, control, control, "a", age)
            other = long.commanded(time, control, control, "a", age)
            assert passed == (other if other is None else pytest.approx(other, abs=TOLERANCE))
        if random.random() < 0.1:
            motion = Motion(
                (0.0, 0.0, random.uniform(0.2, 2.2)), (0.0, 0.0, random.uniform(-1.0, 2.5))
            )
        if k % 4 == 0:
            for machine in (short, long):
                machine.measure(motion)
            mine, other = short.tick(time), long.tick(time)
            assert (mine is None) == (other is None)
            assert mine is None or mine == pytest.approx(other, abs=TOLERANCE)
            assert short.relay.hover == pytest.approx(long.relay.hover, abs=TOLERANCE)
        assert short.state is long.state
        assert short.silence == pytest.approx(long.silence)
    assert taken > 20 or short.state is not FilterState.PASSING


def facts(value):
    """Return all that a machine or a part of it knows, numbers to the last bit."""
    if hasattr(value, "__dict__") and not isinstance(value, FlightState | FilterState):
        return {name: facts(each) for name, each in vars(value).items()}
    return repr(value)


@given(st.integers(0), st.sampled_from([FLYING, TAKING_OFF]))
def test_a_nominal_tick_leaves_what_a_whole_one_does(seed, state):
    """Random flights of two filters, one of which looks at everything in each tick."""
    random, short, whole = Random(seed), flying(state=state), flying(state=state)
    time, motion = 1.0, at(1.0)
    for _ in range(300):
        time += random.choice([0.01, 0.01, 0.01, 0.04, 0.002, 0.0, -0.01, 0.3, 2.0][: 5 + seed % 5])
        thrust = random.gauss(G + 0.5, 1.0 if random.random() < 0.95 else 5.0)
        control = SafeSetpoint(random.gauss(0.0, 0.05), random.gauss(0.0, 0.1), 0.1, thrust)
        caller = "a" if random.random() < 0.98 else "b"
        if random.random() < 0.1:
            height, speed = random.uniform(0.2, 2.2), random.uniform(-1.0, 2.5)
            motion = Motion((0.0, 0.0, height), (0.0, 0.0, speed))
        events = [
            event
            for event, share in [("measure", 0.7), ("control", 0.9), ("takeoff", 0.01)]
            if random.random() < share
        ]
        outputs = []
        for machine in (short, whole):
            if "measure" in events:
                machine.measure(motion)
            if "control" in events and not machine.pass_unchanged(time, control, 0.0):
                outputs.append(machine.commanded(time, control, control, caller))
            if "takeoff" in events:
                outputs.append(machine.takeoff(time, control, control, "server"))
            if machine is whole:
                machine.passes_unchanged = False
            outputs.append(machine.tick(time))
        half = len(outputs) // 2
        assert outputs[:half] == outputs[half:]
        assert facts(short) == facts(whole)
