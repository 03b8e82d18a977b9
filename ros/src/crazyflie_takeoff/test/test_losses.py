"""The filter holds the vehicle and brings it down when no control comes."""

from dataclasses import replace

import pytest
from filter_flight import (
    LIMITS,
    Flight,
    G,
    level,
)
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_takeoff.envelope import Box
from crazyflie_takeoff.fallback import SINK_SPEED, SafeSetpoint
from crazyflie_takeoff.phases import FilterState


def test_holds_after_a_tenth_of_a_second_and_goes_on_without_a_step():
    flight = Flight().run(3.0).lose()
    flight.run(0.08)
    assert flight.filter.state is FilterState.PASSING
    flight.run(0.02)
    assert flight.filter.state is FilterState.HOLDING
    before = len(flight.flown)
    flight.run(0.4)
    assert len(flight.flown) == before + 40
    # No state comes, either: it begins to sink.
    assert flight.flown[before : before + 10] == pytest.approx([G] * 10, abs=0.05)
    assert all(G - 0.25 < thrust < G + 0.05 for thrust in flight.flown[before:])
    # The controller comes back with a burst.
    returned = []
    for k in range(30):
        flight.ticks += 1
        out = flight.filter.commanded(flight.time, 16.0, level(16.0))
        returned.append(out.thrust if isinstance(out, SafeSetpoint) else out)
        assert flight.filter.tick(flight.time) is None
        assert k == 0 or abs(returned[-1] - returned[-2]) < 0.4
    assert returned[0] == pytest.approx(flight.flown[before + 39], abs=0.1)
    assert returned[-1] == 16.0
    assert flight.filter.state is FilterState.PASSING


@pytest.mark.parametrize(("height", "impact"), [(0.5, 0.7), (1.0, 0.9), (2.0, 1.3)])
def test_comes_down_blindly(height, impact):
    flight = Flight(height).run(3.0).lose()
    duration = flight.run_until_off()
    assert duration == pytest.approx(5.6 + height / SINK_SPEED, abs=0.1)
    assert 0.3 < flight.vehicle.touchdown_speed < impact
    assert flight.vehicle.z == 0.0
    assert flight.flown[-1] == 0.0


def test_a_height_that_was_never_known_makes_no_descent_longer():
    flight = Flight()
    flight.sees = False
    assert flight.run(3.0).lose().run_until_off() == pytest.approx(5.6, abs=0.1)


@pytest.mark.parametrize("height", [2.0, 2.5, 2.9])
def test_a_blind_descent_lasts_for_the_last_known_height(height):
    flight = Flight(height).run(3.0).lose()
    # It has learned too much for the thrust of hover, and so sinks more slowly.
    flight.hover -= 0.15
    flight.run_until_off()
    assert 0.3 < flight.vehicle.touchdown_speed < 1.25
    assert flight.vehicle.z == 0.0


@given(st.floats(0.3, 2.0), st.floats(0.8 * G, 1.2 * G), st.floats(-0.8, 1.0), st.booleans())
def test_comes_down_whatever_it_weighs_and_however_it_moved(height, hover, speed, pose):
    flight = Flight(height, hover).run(8.0)
    flight.target = speed
    flight.run(1.0)
    flight.vehicle.z = height
    flight.run(0.01).lose(pose)
    lost = len(flight.flown)
    top = 0.0
    while flight.filter.state is not FilterState.DOWN:
        flight.run(0.01)
        top = max(top, flight.vehicle.z)
        assert flight.time < 100.0
    flight.run(0.3)
    assert flight.vehicle.z == 0.0
    assert top < height + 0.6
    assert flight.vehicle.touchdown_speed < 1.6
    assert max(flight.flown[lost:]) <= 1.25 * G + 1e-9


@pytest.mark.parametrize("height", [1.0, 2.0])
@pytest.mark.parametrize("share", [0.05, 0.09, 0.12, 0.16, 0.2])
def test_a_vehicle_that_weighs_less_than_was_learned_is_brought_down_with_its_motors_on(
    height, share
):
    flight = Flight(height).run(8.0)
    # It drops a load, and the controller ends.
    flight.hover *= 1.0 - share
    flight.lose(pose=False).run_until_off(20.0)
    assert flight.vehicle.z == 0.0
    assert flight.vehicle.touchdown_speed < 0.5


def test_noise_of_the_speed_does_not_stop_the_motors_in_a_slow_descent():
    high = replace(LIMITS, box=Box((-2.0, -2.0, -1.0), (2.0, 2.0, 12.0)))
    flight = Flight(8.0, limits=high, noise=0.1).run(8.0)
    # With less weight than was learned it is still in the air when its time is over.
    flight.hover *= 0.95
    flight.lose(pose=False).run_until_off(40.0)
    assert flight.vehicle.z == 0.0


def test_it_holds_the_vehicle_with_the_thrust_that_was_learned():
    flight = Flight(hover=10.8).run(10.0).lose(pose=False).run(0.3)
    assert flight.filter.state is FilterState.HOLDING
    assert flight.flown[-1] == pytest.approx(10.8, abs=0.1)


def test_what_the_last_control_has_done_is_ended_without_a_step():
    flight = Flight().run(2.5).lose()
    flight.fly(flight.filter.commanded(flight.time, 16.0, level(16.0)))
    begin = len(flight.flown)
    flight.run(0.11)
    assert flight.filter.state is FilterState.HOLDING
    flight.flown = flight.flown[begin:]
    held = len(flight.flown) - 1
    flight.run(1.0)
    assert flight.filter.state is FilterState.SINKING
    thrusts = flight.flown[held:]
    # In 0.1 s it has gained 0.6 m/s, which is led to zero in 0.3 s.
    assert thrusts[0] - G == pytest.approx(-0.6 / 0.3, abs=0.2)
    assert abs(thrusts[70] - G) < 0.6
    assert max(abs(b - a) for a, b in zip(thrusts, thrusts[1:], strict=False)) < 0.2


def test_with_a_known_height_it_comes_down_at_a_known_speed_also_from_high_up():
    flight = Flight(2.9).run(2.0).lose(pose=False)
    duration = flight.run_until_off()
    assert 0.3 < flight.vehicle.touchdown_speed < 0.5
    assert duration > 7.0
    assert flight.flown[-1] == 0.0


@pytest.mark.parametrize("speed", [0.3, 0.6, 1.0])
def test_a_climb_without_a_controller_ends_within_its_braking_distance(speed):
    flight = Flight().run(3.0)
    flight.vehicle.z_dot = flight.target = speed
    begin = flight.run(0.01).lose(pose=False).vehicle.z
    top = max(flight.run(0.01).vehicle.z for _ in range(200)) - begin
    # 0.1 s until the filter takes over, then the speed is led to zero in 0.3 s.
    assert top < 0.42 * speed


def test_the_pose_that_comes_back_starts_nothing():
    flight = Flight().run(2.0).lose().run(1.0)
    assert flight.filter.state is FilterState.SINKING
    flight.controls = flight.sees = True
    flight.target = 2.0
    flight.run_until_off()
    flight.run(5.0)
    assert flight.vehicle.z == 0.0
    assert set(flight.flown[-400:]) == {0.0}
    # A server that knows only the toggle lands, and says so.
    flight.filter.toggle()
    assert flight.filter.takeoff(flight.time, "ramp", level(G)) is None
    flight.run(1.0)
    assert flight.vehicle.z == 0.0
    # It takes off again.
    assert flight.filter.takeoff(flight.time, "lift", level(G + 0.2)) == "lift"
    assert flight.filter.state is FilterState.PASSING


def test_a_foreign_server_that_only_toggles():
    flight = Flight(with_state=False)
    assert flight.filter.takeoff(flight.time, "zero", level(0.0)) == "zero"
    assert flight.filter.takeoff(flight.time, "lift", level(G + 0.2)) == "lift"
    flight.run(1.0)
    flight.filter.toggle()
    assert flight.filter.facts.in_flight
    flight.run(2.0).lose()
    flight.run_until_off()
    assert flight.flown[-1] == 0.0
    flight.filter.toggle()
    assert flight.filter.facts.remembered is None


def test_who_was_stopped_has_not_waited():
    flight = Flight().run(1.0)
    for ticks in (3000, -4000):
        flight.ticks += ticks
        flight.fly(flight.filter.tick(flight.time))
    flight.run(1.0)
    assert flight.filter.state is FilterState.PASSING
    assert max(flight.flown) < G + 0.1


@pytest.mark.parametrize(("seen", "share"), [(0.5, 0.1), (0.5, 0.15), (1.0, 0.15), (1.0, 0.2)])
def test_a_blind_hold_uses_the_last_motion_where_the_thrust_of_hover_is_not_learned_yet(
    seen, share
):
    """It has dropped a load; before the mean of the last seconds is right, poses are lost."""
    flight = Flight(1.0).run(8.0)
    flight.hover *= 1.0 - share
    flight.run(seen).lose()
    top = 0.0
    while flight.filter.state is not FilterState.DOWN:
        flight.run(0.01)
        top = max(top, flight.vehicle.z)
    assert top < 1.35
    assert flight.vehicle.z == 0.0
