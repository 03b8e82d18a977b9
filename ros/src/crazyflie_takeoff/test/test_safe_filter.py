"""The filter with what makes it safe, with a clock moved by hand and a vehicle in closed loop."""

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from takeoff_helpers import PointMass

from crazyflie_takeoff.filter_mode import Mode, Patience
from crazyflie_takeoff.flight_state import FlightState, Takeover
from crazyflie_takeoff.limits import Box, Limits
from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import (
    MAX_BRAKING,
    MAX_SAFE_TILT,
    MOTORS_OFF,
    SINK_SPEED,
    HoverThrust,
    SafeControl,
    Setpoint,
)
from crazyflie_takeoff.safe_filter import SafeFilter
from crazyflie_utils.refusal import RefusalError

G = 9.81
ON_GROUND, TAKING_OFF, FLYING, DESCENDING, LANDING = FlightState
LIMITS = Limits(Box((-2.0, -2.0, -1.0), (2.0, 2.0, 3.0)), 0.5, -0.5)
PATIENCE = Patience(0.1, 0.5, 5.0)


def level(thrust):
    return Setpoint(0.0, 0.0, 0.0, thrust)


class Flight:
    """A filter above a vehicle, whose true hover thrust is not what it is believed to be."""

    def __init__(self, height=1.0, hover=G, speed=0.0, sees=True, with_state=True):
        self.filter = SafeFilter(PATIENCE, LIMITS)
        self.vehicle = PointMass(height)
        self.vehicle.z_dot = speed
        self.hover = hover
        self.ticks = 0
        self.controls = True
        self.sees = sees
        self.target = speed
        self.flown = []
        self.filter.stop_listening(0.0)
        if with_state:
            self.filter.set_state(FLYING)
        self.fly(level(hover))

    @property
    def time(self):
        return 50.0 + self.ticks / 100

    def fly(self, control):
        if isinstance(control, (Setpoint, float)):
            thrust = control.thrust if isinstance(control, Setpoint) else control
            self.flown.append(thrust)
            # The point mass knows g only.
            self.vehicle.command(thrust - self.hover + G if thrust > 0.0 else 0.0)

    def run(self, duration):
        """Let time pass; the controller keeps the vertical speed that it had."""
        for _ in range(round(duration * 100)):
            self.ticks += 1
            self.vehicle.advance(0.01)
            if self.sees:
                position = (0.0, 0.0, self.vehicle.z)
                self.filter.measure(Motion(position, (0.0, 0.0, self.vehicle.z_dot)))
            if self.controls:
                thrust = self.hover + 2.0 * (self.target - self.vehicle.z_dot)
                self.fly(self.filter.commanded(self.time, thrust, level(thrust)))
            self.fly(self.filter.tick(self.time))
        return self

    def run_until_off(self, limit=30.0):
        start = self.time
        while self.filter.mode is not Mode.DOWN:
            self.run(0.01)
            assert self.time - start < limit
        return self.time - start

    def lose(self, pose=True):
        """Lose the pose, so that neither states nor controls come; or only the controls."""
        self.controls, self.sees = False, not pose
        return self


def test_a_controller_that_speaks_is_passed_on_as_it_is():
    control_filter = SafeFilter(PATIENCE, LIMITS)
    control_filter.set_state(FLYING)
    messages = [object() for _ in range(500)]
    for k, message in enumerate(messages):
        assert control_filter.tick(k / 100) is None
        assert control_filter.commanded(k / 100, message, level(12.0)) is message


def test_holds_after_a_tenth_of_a_second_and_goes_on_without_a_step():
    flight = Flight().run(3.0).lose()
    flight.run(0.08)
    assert flight.filter.mode is Mode.PASSING
    flight.run(0.02)
    assert flight.filter.mode is Mode.HOLDING
    before = len(flight.flown)
    flight.run(0.4)
    assert len(flight.flown) == before + 40
    assert flight.flown[before:] == pytest.approx([G] * 40, abs=0.05)
    # The controller comes back with a burst.
    returned = []
    for k in range(30):
        flight.ticks += 1
        out = flight.filter.commanded(flight.time, 16.0, level(16.0))
        returned.append(out.thrust if isinstance(out, Setpoint) else out)
        assert flight.filter.tick(flight.time) is None
        assert k == 0 or abs(returned[-1] - returned[-2]) < 0.4
    assert returned[0] == pytest.approx(G, abs=0.1)
    assert returned[-1] == 16.0
    assert flight.filter.takeover is None


@pytest.mark.parametrize(("height", "impact"), [(0.5, 0.65), (1.0, 0.85), (2.0, 1.15)])
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
    # It has learned too much for the thrust of hover, and so sinks at half the rate.
    flight.hover -= 0.15
    flight.run_until_off()
    assert 0.3 < flight.vehicle.touchdown_speed < 1.1
    assert flight.vehicle.z == 0.0


@settings(max_examples=60, deadline=None)
@given(st.floats(0.3, 2.0), st.floats(0.8 * G, 1.2 * G), st.floats(-0.8, 1.0), st.booleans())
def test_comes_down_whatever_it_weighs_and_however_it_moved(height, hover, speed, pose):
    flight = Flight(height, hover).run(8.0)
    flight.target = speed
    flight.run(1.0)
    flight.vehicle.z = height
    flight.run(0.01).lose(pose)
    lost = len(flight.flown)
    top = 0.0
    while flight.filter.mode is not Mode.DOWN:
        flight.run(0.01)
        top = max(top, flight.vehicle.z)
        assert flight.time < 100.0
    flight.run(0.3)
    assert flight.vehicle.z == 0.0
    assert top < height + 0.6
    assert flight.vehicle.touchdown_speed < 1.6
    assert max(flight.flown[lost:]) <= 1.25 * G + 1e-9


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
    assert flight.filter.takeover is Takeover.SINKING
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
    assert flight.filter.mode is Mode.PASSING


def test_a_foreign_server_that_only_toggles():
    flight = Flight(with_state=False)
    assert flight.filter.takeoff(flight.time, "zero", level(0.0)) == "zero"
    assert flight.filter.takeoff(flight.time, "lift", level(G + 0.2)) == "lift"
    flight.run(1.0)
    flight.filter.toggle()
    flight.run(2.0).lose()
    flight.run_until_off()
    assert flight.flown[-1] == 0.0
    assert flight.filter.remembered is None


def test_a_takeoff_without_a_controller_is_brought_down():
    control_filter = SafeFilter(PATIENCE, LIMITS)
    control_filter.set_state(TAKING_OFF)
    modes = []
    for k in range(500):
        if k < 100:
            control_filter.takeoff(k / 100, "lift", level(G + 0.2))
        control_filter.tick(k / 100)
        modes.append(control_filter.mode)
    assert modes.index(Mode.HOLDING) == pytest.approx(150, abs=2)
    assert modes.index(Mode.SINKING) == pytest.approx(200, abs=3)


def test_zero_thrust_on_the_ground_is_no_loss():
    control_filter = SafeFilter(PATIENCE, LIMITS)
    for state in (ON_GROUND, LANDING):
        control_filter.set_state(state)
        control_filter.takeoff(0.0, "zero", level(0.0))
        assert [control_filter.tick(k / 100) for k in range(300)] == [None] * 300


def test_who_was_stopped_has_not_waited():
    flight = Flight().run(1.0)
    flight.ticks += 3000
    assert flight.filter.tick(flight.time) is None
    flight.ticks -= 4000
    assert flight.filter.tick(flight.time) is None
    flight.run(1.0)
    assert flight.filter.mode is Mode.PASSING
    assert max(flight.flown) < G + 0.1


def test_learns_the_thrust_of_hover_also_from_a_climb():
    hover = HoverThrust()
    for k in range(1000):
        hover.update(0.01, level(10.8 + (0.5 if k >= 900 else 0.0)), max(0.0, (k - 900) * 0.005))
    assert hover.value == pytest.approx(10.8, abs=0.03)
    for _ in range(1000):
        hover.update(0.01, level(16.0), None)
    assert hover.value == 1.25 * G


def test_takes_no_drag_for_weight():
    hover = HoverThrust()
    z_dot = 0.0
    for k in range(1000):
        target = 1.0 if 600 <= k < 800 else 0.0
        thrust = min(max(G + 5.0 * (target - z_dot), 4.0), 16.0)
        hover.update(0.01, level(thrust), z_dot)
        z_dot += 0.01 * (thrust - G - 0.2 * z_dot)
        assert hover.value == pytest.approx(G, abs=0.06)


def test_learns_the_vertical_part_of_a_tilted_thrust():
    tilted = HoverThrust()
    for _ in range(2000):
        tilted.update(0.01, Setpoint(0.2, 0.0, 0.0, G / math.cos(0.2)), 0.0)
    assert tilted.value == pytest.approx(G)


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
        if flight.filter.mode is Mode.EMERGENCY and stopped is None:
            stopped = k
            flight.flown.clear()
    assert 9 <= stopped <= 13
    assert set(flight.flown) == {0.0}
    assert words in flight.filter.explanation


def test_one_measurement_that_is_wrong_is_no_crash():
    flight = Flight().run(1.0)
    for _ in range(20):
        flight.filter.measure(Motion((9.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
        flight.run(0.05)
        flight.run(0.05)
    assert flight.filter.mode is Mode.PASSING


def test_within_half_a_metre_of_the_wall_the_geofence_is_at_work():
    flight = Flight().run(0.1)
    for _ in range(100):
        flight.filter.measure(Motion((2.45, -2.45, 1.0), (0.0, 0.0, 0.0)))
        flight.sees = False
        flight.run(0.01)
    assert flight.filter.mode is Mode.PASSING


def test_a_vehicle_that_tilts_over_is_stopped():
    flight = Flight().run(1.0)
    flight.filter.set_tilted(True)
    flight.run(0.02)
    assert flight.filter.mode is Mode.EMERGENCY
    assert "the vehicle has tilted over" in flight.filter.explanation


def test_a_vehicle_that_is_carried_exceeds_no_limit():
    control_filter = SafeFilter(PATIENCE, LIMITS)
    control_filter.set_state(ON_GROUND)
    for k in range(100):
        control_filter.measure(Motion((9.0, 0.0, -9.0), (0.0, 0.0, 0.0)))
        control_filter.set_tilted(True)
        control_filter.tick(k / 100)
    assert control_filter.mode is Mode.PASSING


# Emergencies.


def test_an_emergency_is_latched_until_it_is_reset():
    flight = Flight().run(1.0)
    with pytest.raises(RefusalError, match="no emergency"):
        flight.filter.reset()
    flight.filter.stop("somebody called")
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


@settings(max_examples=300, deadline=None)
@given(EVENTS)
@example(["toggle", (0.0, 0.0), (0.0, -2.0), 6, 0.5])
def test_whatever_happens_when(events):
    """Random messages, services and clocks: what must hold of all that is published."""
    control_filter = SafeFilter(PATIENCE, LIMITS)
    thrusts = {"lift": G + 0.2, "ramp": 7.0, "zero": 0.0}
    time = 100.0
    for event in events:
        was_emergency = control_filter.mode is Mode.EMERGENCY
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
            control_filter.set_state(event)
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
            assert control_filter.mode is Mode.EMERGENCY
        if was_emergency or event == "stop":
            assert out is None
    assert (control_filter.takeover is Takeover.EMERGENCY) == (
        control_filter.mode is Mode.EMERGENCY
    )


def check(control_filter, out):
    if isinstance(out, Setpoint):
        roll, pitch, yaw_dot, thrust = out
        assert thrust == 0.0 or 0.5 * G < thrust <= 1.25 * G + 1e-9
        assert max(abs(roll), abs(pitch)) <= MAX_SAFE_TILT
        assert yaw_dot == 0.0
    if control_filter.mode in (Mode.EMERGENCY, Mode.DOWN):
        assert out is None or out == MOTORS_OFF
    if control_filter.mode is Mode.SINKING:
        assert out is None or isinstance(out, Setpoint)


def test_a_state_that_is_the_last_one_is_not_taken_again():
    # 0.2 s at full thrust after it, the vehicle rises by 1.2 m/s more: that is braked at once.
    motion = Motion((0.0, 0.0, 0.5), (0.0, 0.0, 0.4))
    safe = SafeControl(G, motion, 0.2, Setpoint(0.0, 0.0, 0.0, 16.0))
    thrusts = [safe.advance(0.01, motion, False).thrust for _ in range(3)]
    assert max(thrusts) == pytest.approx(G - MAX_BRAKING)
    # A new one counts.
    slow = motion._replace(velocity=(0.0, 0.0, 0.0))
    assert safe.advance(0.01, slow, False).thrust > G - 1.0
