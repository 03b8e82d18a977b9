"""Controls as passed on: late ones, the hover that is learned, the short way of nominal ones."""

import math
from random import Random

import pytest
from filter_flight import FLYING, LIMITS, ON_GROUND, TAKING_OFF, TIMEOUTS, G, Supervised, at, level
from hypothesis import example, given
from hypothesis import strategies as st

from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MAX_YAW_RATE, MIN_THRUST
from crazyflie_takeoff.facts import Facts, Timeouts
from crazyflie_takeoff.fallback import SafeSetpoint
from crazyflie_takeoff.hover_thrust import LAG
from crazyflie_takeoff.motion import Motion

TILTED = SafeSetpoint(0.2, -0.1, 1.0, G + 0.5)


def slow(state):
    """Return a supervisor whose controls fade from 0.125 s to 0.25 s."""
    control_filter = Supervised(Timeouts(0.25, 0.5, 5.0, 3.0))
    control_filter.stop_listening(0.0)
    control_filter.flight_state = state
    return control_filter


def ticks(control_filter, count):
    """Return what is sent after each 1/64 s, and how a control that has half faded looks then."""
    sent = []
    for _ in range(count):
        out = control_filter.tick(control_filter.facts.now + 1 / 64)
        sent.append((out, TILTED.mixed(level(control_filter.facts.hover), 0.5)))
    return sent


def test_a_control_that_is_late_fades_to_level_hover():
    control_filter = slow(FLYING)
    assert [sent for sent, _ in ticks(control_filter, 16)] == [None] * 16
    assert control_filter.commanded(0.25, "control", TILTED) == "control"
    sent = ticks(control_filter, 16)
    assert [out is None for out, _ in sent] == [True] * 8 + [False] * 8
    assert sent[11][0] == pytest.approx(sent[11][1])
    assert sent[15][0] == level(control_filter.facts.hover)


@pytest.mark.parametrize(
    ("age", "weight"), [(0.125, 0.0), (0.13, 0.04), (0.1875, 0.5), (0.25, 1.0)]
)
def test_a_control_that_is_made_of_old_data_fades_too(age, weight):
    control_filter = slow(FLYING)
    ticks(control_filter, 16)
    passed = control_filter.commanded(0.25, TILTED, TILTED, age=age)
    assert passed == pytest.approx(TILTED.mixed(level(G), weight))


def test_a_control_of_old_data_is_dropped_also_right_after_one_of_new_data():
    control_filter = slow(FLYING)
    assert control_filter.commanded(0.01, "control", TILTED) == "control"
    assert control_filter.commanded(0.02, "old", TILTED, age=3.0) is None


def test_a_late_control_is_not_learned_from():
    control_filter = slow(FLYING)
    for k in range(1, 1000):
        control_filter.measure(at(1.0), time=0.01 * k)
        control_filter.commanded(0.01 * k, "control", level(G + 1.0))
        control_filter.tick(0.01 * k)
    # A control of much thrust is the last one; it fades, and states still come.
    control_filter.commanded(9.99, "control", level(16.0))
    for k in range(1000, 1100):
        control_filter.measure(at(1.0), time=0.01 * k)
        if k == 1025:
            hover = control_filter.facts.hover
    assert control_filter.facts.hover == pytest.approx(hover)


def test_a_takeoff_control_that_is_late_fades_for_half_a_second():
    control_filter = slow(TAKING_OFF)
    assert control_filter.takeoff(0.0, "lift", TILTED) == "lift"
    sent = ticks(control_filter, 32)
    assert [out is None for out, _ in sent] == [True] * 8 + [False] * 24
    assert sent[11][0] == pytest.approx(sent[11][1])
    assert sent[15][0] == sent[31][0] == level(G)
    assert control_filter.commanded(0.5, "control", TILTED) == level(G)
    # Then it is the controller's turn.
    assert control_filter.tick(0.51) is None
    assert control_filter.commanded(0.51, "control", TILTED) == "control"


@pytest.mark.parametrize(
    ("state", "thrust"), [(TAKING_OFF, G), (FLYING, G + 0.5), (ON_GROUND, 0.0)]
)
def test_no_control_of_a_ramp_fades_and_none_in_flight_or_on_the_ground(state, thrust):
    control_filter = slow(state)
    control_filter.takeoff(0.0, "ramp", level(thrust))
    assert [out for out, _ in ticks(control_filter, 16)] == [None] * 16


@pytest.mark.parametrize(
    ("step", "is_flown", "learned"),
    [(0.1875, True, 0.1875 / 2.1875), (0.25, True, 0.0), (0.125, False, 0.0), (-0.5, True, 0.0)],
)
def test_hover_is_learned_between_states_that_follow_each_other_in_flight(step, is_flown, learned):
    facts = Facts(TIMEOUTS, LIMITS)
    facts.set_hover(G)
    facts.measure(1.0, at(1.0))
    facts.flown = level(G + 1.0) if is_flown else None
    facts.measure(1.0 + step, at(1.0))
    assert facts.hover - G == pytest.approx(learned * step / (LAG + step), abs=1e-12)


def test_what_a_vehicle_accelerates_by_is_not_learned():
    facts = Facts(TIMEOUTS, LIMITS)
    facts.set_hover(G)
    facts.flown = level(G + 1.0)
    for tick in range(200):
        climb = 0.01 * max(tick - LAG / 0.01, 0.0)
        facts.measure(tick / 100, Motion((0.0, 0.0, 1.0), (9.0, 9.0, climb)))
        assert facts.hover == pytest.approx(G, abs=0.02)


def test_what_happens_while_the_filter_does_not_run_is_not_learned():
    facts = Facts(TIMEOUTS, LIMITS)
    facts.flown = level(G)
    for tick in range(300):
        facts.measure(tick / 100, at(1.0))
    # It climbs, and then falls: its motors stop 2 s after the last control.
    for time, thrust in ((5.0, 16.0), (5.0, G), (5.01, G)):
        facts.measure(time, at(4.0, -5.0))
        facts.flown = level(thrust)
        assert facts.hover == pytest.approx(G)


def test_without_a_state_a_vehicle_neither_climbs_nor_falls():
    control_filter = slow(FLYING)
    control_filter.commanded(0.0, "control", level(G))
    # 0.5 m/s within the pause.
    assert control_filter.commanded(0.25, "control", level(G + 9.0)).thrust - G == pytest.approx(
        2.0
    )


@pytest.mark.parametrize(("state", "least"), [(FLYING, MIN_THRUST), (None, 0.0)])
def test_the_least_thrust_of_a_control(state, least):
    control_filter = slow(state)
    assert control_filter.commanded(0.0, "control", level(-3.0)) == level(least)
    assert control_filter.takeoff(0.0, "ramp", level(-3.0)) == level(0.0)


# The short way.

#: Tolerance of thrusts (m/s^2): the short way forgets pauses in fewer steps.
TOLERANCE = 0.002


def flying(z=1.0, state=FLYING):
    """Return a supervisor whose nominal flight, or climb, has lasted for a second."""
    control_filter = Supervised()
    control_filter.flight_state = state
    for k in range(-100 if state is TAKING_OFF else 0, 101):
        if k < -60:
            control_filter.takeoff(0.01 * k, "thrust", level(G + 0.2), "server")
        control_filter.measure(at(z), time=0.01 * k)
        control_filter.commanded(0.01 * k, "control", level(G))
        control_filter.tick(0.01 * k)
    return control_filter


@pytest.mark.parametrize("state", [FLYING, TAKING_OFF])
def test_a_nominal_control_passes_unchanged(state):
    passes = flying(state=state).pass_unchanged
    assert passes(1.01, level(G))
    assert passes(1.02, SafeSetpoint(MAX_TILT, -MAX_TILT, MAX_YAW_RATE, MAX_THRUST))
    assert passes(1.03, level(MIN_THRUST), 0.04)
    assert not passes(1.04, level(MIN_THRUST), 0.05)
    # Until the filter has to run again.
    assert passes(1.049, level(MIN_THRUST))
    assert not passes(1.06, level(MIN_THRUST))
    assert not passes(0.99, level(MIN_THRUST))


@pytest.mark.parametrize(
    "event",
    [
        lambda it: it.stop("it was called"),
        lambda it: it.measure(at(9.0)),
        lambda it: it.measure(at(1.0, 2.2)),
        lambda it: it.takeoff(1.01, "zero", level(0.0), "server"),
        lambda it: it.commanded(1.01, "other", level(G), "other"),
    ],
)
def test_whatever_happens_ends_the_short_way_until_the_next_tick(event):
    control_filter = flying()
    event(control_filter)
    assert not control_filter.pass_unchanged(1.01, level(G))


@pytest.mark.parametrize(
    ("z", "z_dot", "passes"),
    [(1.0, 1.9, True), (1.0, 2.0, False), (2.0, 0.0, True), (2.2, 0.0, False)],
)
def test_a_fast_or_high_climb_takes_the_long_way(z, z_dot, passes):
    control_filter = flying()
    # The wall is at 3 m; 0.25 m above it, and 3 m/s end within 1.125 m.
    control_filter.measure(at(z, z_dot))
    control_filter.commanded(1.01, "control", level(G))
    control_filter.tick(1.01)
    assert control_filter.pass_unchanged(1.02, level(G)) == passes


def test_without_states_hover_is_learned_on_the_short_way():
    control_filter, taken = Supervised(), 0
    control_filter.flight_state = FLYING
    for k in range(1000):
        control = level(G + 1.0)
        if control_filter.pass_unchanged(0.01 * k, control):
            taken += 1
        else:
            control_filter.commanded(0.01 * k, control, control)
        if k % 4 == 0:
            control_filter.tick(0.01 * k)
    assert taken > 900
    assert control_filter.facts.hover == pytest.approx(G + 1.0, abs=0.02)


def happen(control_filter, inputs, takes_it=True):
    """Return what is sent after each input, and how many controls took the short way."""
    sent, taken = [], 0
    for give, time, *what in inputs:
        if not takes_it:
            control_filter.memory.clear_until = -math.inf
        if give == "measure":
            control_filter.measure(*what, time=time)
        elif give == "takeoff":
            sent.append(control_filter.takeoff(time, *what))
        elif give == "tick":
            sent.append(control_filter.tick(time))
        elif give == "same" and control_filter.pass_unchanged(time, what[0], what[3]):
            sent.append(what[0])
            taken += 1
        else:
            sent.append(control_filter.commanded(time, *what))
    return sent, taken


@given(st.integers(0), st.sampled_from([FLYING, TAKING_OFF]))
# Controls between two ticks, none of them late.
@example(seed=25264160, state=TAKING_OFF)
# A long pause after a nominal flight, and more of them.
@example(seed=397922608, state=FLYING)
def test_the_short_way_leads_where_the_long_one_does(seed, state):
    """Random flights of two supervisors, one of which never takes it."""
    random, short, long = Random(seed), flying(state=state), flying(state=state)
    time, total, name, motion = 1.0, 0, "", at(1.0)
    steps = [0.01, 0.01, 0.01, 0.002, 0.03, 0.04, 0.0, -0.01, 0.3, 2.0][: 5 + seed % 6]
    for k in range(400):
        time += random.choice(steps)
        thrust = random.gauss(G + 0.5, 1.0 if random.random() < 0.9 else 5.0)
        control = SafeSetpoint(random.gauss(0.0, 0.05), random.gauss(0.0, 0.1), 0.1, thrust)
        if random.random() < 0.1:
            motion = at(random.uniform(0.2, 2.2), random.uniform(-1.0, 2.5))
        inputs = []
        if random.random() < 0.7:
            inputs.append(("measure", time, motion))
        if random.random() < 0.95:
            # A clock that is set back makes two publishers one.
            is_other = min(steps) >= 0.0 and random.random() < 0.01
            former, name = name, "other" if is_other else ""
            age = random.choice([0.0, 0.0, 0.0, 0.01, 0.06])
            give = "same" if name == former else "other"
            inputs.append((give, time, control, control, name, age))
        if random.random() < 0.001:
            inputs.append(("takeoff", time, control, control, "server"))
        if k % 4 == 0:
            inputs.append(("tick", time))
        mine, taken = happen(short, inputs)
        others, _ = happen(long, inputs, takes_it=False)
        total += taken
        for my, other in zip(mine, others, strict=True):
            assert my == (other if other is None else pytest.approx(other, abs=TOLERANCE))
        assert short.memory.phase is long.memory.phase
        assert short.facts.silence == pytest.approx(long.facts.silence)
        assert short.facts.hover == pytest.approx(long.facts.hover, abs=TOLERANCE)
    # Long pauses end the short way for seconds.
    assert total > 20 or max(steps) > 0.04 or not short.memory.phase.follows
