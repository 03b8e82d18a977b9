"""Limits, emergencies, and random lives of the filter."""

import pytest
from filter_flight import DESCENDING, ON_GROUND, Flight, G, Supervised, level
from hypothesis import example, given
from hypothesis import strategies as st

from crazyflie_model.limits import MIN_THRUST
from crazyflie_takeoff.fallback import MAX_SAFE_TILT, MOTORS_OFF, SafeSetpoint
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.phases import FilterState, FlightState
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
    assert words in flight.filter.reason


def test_one_measurement_that_is_wrong_is_no_crash():
    flight = Flight().run(1.0)
    for _ in range(20):
        flight.filter.measure(Motion((9.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
        flight.run(0.05)
        flight.run(0.05)
    assert flight.filter.state is FilterState.PASSING


def test_a_vehicle_that_is_carried_exceeds_no_limit():
    control_filter = Supervised()
    control_filter.flight_state = ON_GROUND
    control_filter.stop_listening(0.0)
    for k in range(100):
        control_filter.measure(Motion((9.0, 0.0, -9.0), (0.0, 0.0, 0.0)))
        control_filter.facts.is_tilted = True
        control_filter.tick(k / 100)
    assert control_filter.state is FilterState.PASSING


def test_on_a_busy_computer_a_control_that_has_come_back_fades_in_all_the_same():
    flight = Flight().run(2.5).lose(pose=False).run(0.2)
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
    flight.run(0.1)
    flight.controls = flight.sees = True
    flight.run(0.1)
    # The filter's own control passes over to the one that has come back.
    assert not flight.filter.is_nominal
    flight.run(0.2)
    assert flight.filter.is_nominal
    flight.filter.facts.is_tilted = True
    assert not flight.filter.is_nominal


def test_on_the_ground_the_filter_is_nominal_without_a_controller():
    control_filter = Supervised()
    control_filter.flight_state = ON_GROUND
    assert not control_filter.is_nominal
    control_filter.stop_listening(0.0)
    for k in range(100):
        control_filter.tick(k / 100)
    assert control_filter.is_nominal
    control_filter.stop("it was called")
    assert not control_filter.is_nominal


# Whatever happens.

EVENTS = st.lists(
    st.one_of(
        st.sampled_from(["commanded", "toggle", "stop", "reset", "lift", "ramp", "zero", "wait"]),
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
    control_filter = Supervised()
    thrusts = {"lift": G + 0.2, "ramp": 7.0, "zero": 0.0}
    time = 100.0
    control_filter.tick(time)
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
        elif event == "wait":
            check(control_filter, control_filter.stop_listening(time))
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
