"""Limits, emergencies, and random lives of the filter."""

import pytest
from filter_flight import DESCENDING, FLYING, LIMITS, ON_GROUND, TIMEOUTS, Flight, G, level
from hypothesis import example, given
from hypothesis import strategies as st

from crazyflie_model.limits import MIN_THRUST
from crazyflie_takeoff.filter_machine import FilterMachine, FilterState
from crazyflie_takeoff.limits import Debounce
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import (
    MAX_SAFE_TILT,
    MOTORS_OFF,
    SafeSetpoint,
)
from crazyflie_takeoff.transition_table import FlightState
from crazyflie_utils.refusal import RefusalError

# Limits.


@pytest.mark.parametrize(
    ("position", "words"),
    [((2.6, 0.0, 1.0), "outside the geofence"), ((0.0, 0.0, -0.6), "below the ground")],
)
def test_motors_stop_beyond_the_limits_and_stay_off(position, words):
    flight = Flight().run(1.0)
    flight.sees = False
    stopped = None
    for k in range(200):
        flight.filter.measure(Motion(position, (0.0, 0.0, 0.0)))
        flight.run(0.01)
        if flight.filter.state is FilterState.EMERGENCY and stopped is None:
            stopped = k
            flight.flown.clear()
    assert 9 <= stopped <= 13
    assert set(flight.flown) == {0.0}
    assert words in flight.filter.status.reason


def test_one_measurement_that_is_wrong_is_no_crash():
    flight = Flight().run(1.0)
    for _ in range(20):
        flight.filter.measure(Motion((9.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
        flight.run(0.05)
        flight.run(0.05)
    assert flight.filter.state is FilterState.PASSING


def test_complaints_that_come_and_go_do_not_add_up():
    debounce = Debounce(0.1)
    for _ in range(20):
        assert debounce.advance(0.09, "far away") == ""
        assert debounce.advance(0.01, "") == ""
    assert debounce.advance(0.09, "far away") == ""
    assert debounce.advance(0.02, "far away") == "far away"


def test_within_half_a_metre_of_the_wall_the_geofence_is_at_work():
    flight = Flight().run(0.1)
    for _ in range(100):
        flight.filter.measure(Motion((2.45, -2.45, 1.0), (0.0, 0.0, 0.0)))
        flight.sees = False
        flight.run(0.01)
    assert flight.filter.state is FilterState.PASSING


def test_a_vehicle_that_tilts_over_is_stopped():
    flight = Flight().run(1.0)
    flight.filter.set_tilted(True)
    flight.run(0.02)
    assert flight.filter.state is FilterState.EMERGENCY
    assert "the vehicle has tilted over" in flight.filter.status.reason


def test_a_vehicle_that_is_carried_exceeds_no_limit():
    control_filter = FilterMachine(TIMEOUTS, LIMITS)
    control_filter.flight_state = ON_GROUND
    for k in range(100):
        control_filter.measure(Motion((9.0, 0.0, -9.0), (0.0, 0.0, 0.0)))
        control_filter.set_tilted(True)
        control_filter.tick(k / 100)
    assert control_filter.state is FilterState.PASSING


# Whose control it is.


def test_a_controller_is_not_passed_on_while_the_server_sends_controls():
    control_filter = FilterMachine(TIMEOUTS, LIMITS)
    assert control_filter.takeoff(0.0, "zero", MOTORS_OFF) == "zero"
    assert control_filter.commanded(0.1, "fly", level(12.0)) == "zero"


def test_of_two_servers_on_the_ground_none_lifts_the_vehicle():
    control_filter = FilterMachine(TIMEOUTS, LIMITS)
    for k, caller in enumerate("ab"):
        assert control_filter.takeoff(0.1 * k, "zero", MOTORS_OFF, caller) == "zero"
    assert control_filter.takeoff(0.2, "lift", level(0.5), "a") == MOTORS_OFF
    assert "two nodes publish takeoff controls" in control_filter.status.takeoff_refusal
    control_filter.stop("it was called")
    assert control_filter.status.takeoff_refusal == ""


def test_two_controllers_in_flight_are_no_reason_to_refuse_takeoffs():
    flight = Flight()
    for k in range(8):
        flight.filter.commanded(0.01 * k, "fly", level(G), "ab"[k % 2])
    assert flight.filter.relay.contention
    assert flight.filter.status.takeoff_refusal == ""


@pytest.mark.parametrize(
    ("z", "passed", "state"),
    [(None, None, FilterState.PASSING), (0.0, None, FilterState.DOWN)]
    + [(1.0, "fly", FilterState.PASSING)],
)
def test_a_filter_that_starts_in_flight_passes_on_what_is_seen_in_the_air(z, passed, state):
    control_filter = FilterMachine(TIMEOUTS, LIMITS, sees=True)
    control_filter.flight_state = FLYING
    if z is not None:
        control_filter.measure(Motion((0.0, 0.0, z), (0.0, 0.0, 0.0)))
    control_filter.tick(0.0)
    assert control_filter.commanded(0.0, "fly", level(G)) == passed
    assert control_filter.state is state


@pytest.mark.parametrize("is_stopped", [True, False])
@pytest.mark.parametrize("is_waiting", [True, False])
def test_what_has_waited_while_the_filter_listened_is_passed_on(is_stopped, is_waiting):
    control_filter = FilterMachine(TIMEOUTS, LIMITS)
    if is_waiting:
        assert control_filter.commanded(0.0, "fly", level(G)) is None
    if is_stopped:
        control_filter.stop("it was called")
    control_filter.flight_state = FLYING
    passes = is_waiting and not is_stopped
    assert control_filter.stop_listening(0.2) == ("fly" if passes else None)


def test_a_vehicle_that_its_controller_does_not_bring_down_is_brought_down():
    flight = Flight().run(1.0)
    flight.filter.flight_state = DESCENDING
    assert flight.run(2.0).filter.state is FilterState.SINKING


def test_on_a_busy_computer_a_control_that_has_come_back_fades_in_all_the_same():
    flight = Flight().run(1.0).lose(pose=False).run(0.2)
    flight.ticks += 20
    own = flight.filter.tick(flight.time).thrust
    # It may stay the last one for a while.
    assert flight.filter.commanded(flight.time, "fly", level(G + 2.0)).thrust < own + 0.1
    flight.ticks += 5
    passed = flight.filter.tick(flight.time)
    assert passed.thrust == pytest.approx(own + 0.25 * (G + 2.0 - own), abs=0.05)


# Required rate of the filter.


def test_a_filter_that_has_little_to_do_is_nominal():
    flight = Flight().run(1.0)
    assert flight.filter.is_nominal
    flight.lose().run(0.04)
    assert flight.filter.is_nominal
    flight.run(0.02)
    assert not flight.filter.is_nominal
    flight.filter.silence = 0.052
    assert not flight.filter.is_nominal
    flight.run(0.1)
    flight.controls = flight.sees = True
    flight.run(0.1)
    # The filter's own control passes over to the one that has come back.
    assert not flight.filter.is_nominal
    flight.run(0.2)
    assert flight.filter.is_nominal
    flight.filter.set_tilted(True)
    assert not flight.filter.is_nominal


def test_on_the_ground_the_filter_is_nominal_without_a_controller():
    control_filter = FilterMachine(TIMEOUTS, LIMITS)
    control_filter.flight_state = ON_GROUND
    for k in range(100):
        control_filter.tick(k / 100)
    assert control_filter.is_nominal
    control_filter.stop("it was called")
    assert not control_filter.is_nominal


def test_a_filter_that_has_not_seen_yet_whether_the_vehicle_is_on_the_ground_is_not_nominal():
    control_filter = FilterMachine(TIMEOUTS, LIMITS, sees=True)
    assert not control_filter.is_nominal
    control_filter.takeoff(0.0, "zero", MOTORS_OFF)
    assert control_filter.is_nominal


# Emergencies.


def test_an_emergency_is_latched_until_it_is_reset():
    flight = Flight().run(1.0)
    with pytest.raises(RefusalError, match="no emergency"):
        flight.filter.reset()
    flight.filter.stop("it was called")
    assert flight.filter.tick(flight.time) == MOTORS_OFF
    with pytest.raises(RefusalError, match="less than 2 s ago"):
        flight.filter.reset()
    flight.flown.clear()
    flight.run(2.5)
    assert flight.filter.takeoff(flight.time, "lift", level(G + 0.2)) is None
    flight.filter.reset()
    flight.run(1.0)
    assert set(flight.flown) == {0.0}
    assert flight.filter.takeoff(flight.time, "lift", level(G + 0.2)) == "lift"


def test_a_vehicle_on_the_ground_does_not_end_the_emergency_of_a_filter_that_has_just_started():
    control_filter = FilterMachine(TIMEOUTS, LIMITS, sees=True)
    control_filter.flight_state = FLYING
    control_filter.tick(0.0)
    control_filter.stop("it was called")
    control_filter.measure(Motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    control_filter.commanded(0.0, "control", level(G))
    assert control_filter.state is FilterState.EMERGENCY


EVENTS = st.lists(
    st.one_of(
        st.sampled_from(["commanded", "toggle", "stop", "reset", "lift", "ramp", "zero"]),
        st.sampled_from(list(FlightState)),
        st.tuples(st.floats(-2.0, 4.0), st.floats(-3.0, 3.0)),
        # Time: ticks, and steps of the clock either way.
        st.integers(1, 80),
        st.floats(-1e4, 1e4),
    ),
    max_size=60,
)


@given(EVENTS)
@example([DESCENDING, (0.0, 1.0), "commanded"])
@example(["toggle", (0.0, 0.0), (0.0, -2.0), 6, 0.5])
@example(["toggle", (0.0, 0.0), 1, 0.5, (0.0, -2.0), "commanded"])
def test_whatever_happens_when(events):
    """Random messages, services and clocks: what must hold of all that is published."""
    control_filter = FilterMachine(TIMEOUTS, LIMITS)
    thrusts = {"lift": G + 0.2, "ramp": 7.0, "zero": 0.0}
    time = 100.0
    for event in events:
        was_emergency = control_filter.state is FilterState.EMERGENCY
        out = None
        if event == "commanded":
            out = control_filter.commanded(time, event, level(11.0))
        elif event in thrusts:
            out = control_filter.takeoff(time, event, level(thrusts[event]))
        elif event == "stop":
            control_filter.stop("said so")
        elif event == "reset":
            try:
                control_filter.reset()
                assert was_emergency
            except RefusalError:
                pass
        elif event == "toggle":
            control_filter.toggle()
        elif isinstance(event, FlightState):
            control_filter.flight_state = event
        elif isinstance(event, tuple):
            control_filter.measure(Motion((0.0, 0.0, event[0]), (0.0, 0.0, event[1])))
        elif isinstance(event, int):
            for _ in range(event):
                time += 0.01
                check(control_filter, control_filter.tick(time))
        else:
            time += event
            check(control_filter, control_filter.tick(time))
        check(control_filter, out)
        if was_emergency and event != "reset":
            assert control_filter.state is FilterState.EMERGENCY
        if was_emergency or event == "stop":
            assert out is None


def check(control_filter, out):
    if isinstance(out, SafeSetpoint):
        roll, pitch, yaw_dot, thrust = out
        # Controls that it passes on are limited to the range of controls.
        least = MIN_THRUST if control_filter.state is FilterState.PASSING else 0.5 * G
        assert thrust == 0.0 or least <= thrust <= 1.25 * G + 1e-9
        assert max(abs(roll), abs(pitch)) <= MAX_SAFE_TILT
        assert yaw_dot == 0.0
    if control_filter.state in (FilterState.EMERGENCY, FilterState.DOWN):
        assert out is None or out == MOTORS_OFF
    if control_filter.state is FilterState.SINKING:
        assert out is None or isinstance(out, SafeSetpoint)
