"""The geofence: what it does to controls, and flights that try to leave it."""

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_geofence import bounds
from crazyflie_geofence.geofence import Geofence, max_horizontal_braking, max_vertical_braking
from crazyflie_geofence.viable_set import response
from crazyflie_model.dynamics import coupled_acceleration
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.quadrotor import TYPES
from crazyflie_model.units import GRAVITY

LOWER, UPPER = (-1.5, -1.0, 0.3), (1.5, 1.2, 2.5)
AXES = bounds.axes(bounds.load("cf21"), 1.4, 2.0)
MIDDLE = (0.0, 0.1, 1.4)
AT_REST = (0.0, 0.0, 0.0)
HOVER = (0.0, 0.0, 0.3, GRAVITY)
PERIOD = 0.01

UNIT = st.floats(-1.0, 1.0)
YAW = st.floats(-math.pi, math.pi)
REGULAR = st.tuples(UNIT, UNIT, UNIT, UNIT).map(
    lambda u: (u[0] * MAX_TILT, u[1] * MAX_TILT, u[2], 10.0 + 6.0 * u[3])
)


def fence(axes=AXES):
    return Geofence(LOWER, UPPER, axes)


def hovering(yaw=0.0, axes=AXES):
    """Return a fence of a vehicle that has hovered for a while."""
    made = fence(axes)
    for k in range(100):
        made.sent(-1.0 + k * PERIOD, HOVER, yaw)
    return made


@given(YAW, REGULAR)
def test_in_the_middle_controls_pass_bit_for_bit(yaw, regular):
    made = fence()
    for k in range(20):
        assert made.control(k * PERIOD, MIDDLE, (0.2, -0.1, 0.1), yaw, regular) == (regular, 0.0)
        made.sent(k * PERIOD, regular, yaw)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2.0, math.pi, -math.pi / 2.0, 0.7])
@pytest.mark.parametrize(("axis", "sign"), [(0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)])
def test_towards_a_wall_it_brakes_and_leaves_the_other_axes_and_the_yaw_alone(yaw, axis, sign):
    position, velocity = list(MIDDLE), [0.0, 0.0, 0.0]
    position[axis] = (UPPER if sign > 0 else LOWER)[axis] - sign * 0.3
    velocity[axis] = sign * 1.5
    other = (axis + 1) % 3
    wanted = [0.0, 0.0, 0.0]
    wanted[axis], wanted[other] = sign * 1.0, 0.5
    regular = control_of(wanted, yaw)
    control, priority = hovering(yaw).control(0.0, tuple(position), tuple(velocity), yaw, regular)
    assert priority == 1.0
    done = coupled_acceleration(control, yaw)
    assert sign * done[axis] == pytest.approx(-AXES[axis].braking, abs=1e-6)
    assert done[other] == pytest.approx(wanted[other], abs=1e-9)
    assert done[3 - axis - other] == pytest.approx(0.0, abs=1e-9)
    assert control[2] == regular[2]


def control_of(acceleration, yaw, yaw_dot=0.3):
    """Return the control of an acceleration, found by iteration."""
    roll = pitch = 0.0
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = acceleration
    forward, left = c * x + s * y, c * y - s * x
    for _ in range(50):
        thrust = (GRAVITY + z) / (math.cos(roll) * math.cos(pitch))
        roll, pitch = math.asin(-left / thrust), math.asin(forward / thrust)
    return roll, pitch, yaw_dot, thrust


@given(st.tuples(UNIT, UNIT, UNIT), st.tuples(UNIT, UNIT, UNIT), YAW, REGULAR)
def test_controls_are_within_limits_wherever_the_vehicle_is(unit, velocity, yaw, regular):
    position = tuple(m + 3.0 * u for m, u in zip(MIDDLE, unit, strict=True))
    speed = tuple(5.0 * v for v in velocity)
    wild = tuple(3.0 * part for part in regular)
    control, priority = fence().control(0.0, position, speed, yaw, wild)
    if priority:
        assert abs(control[0]) <= MAX_TILT
        assert abs(control[1]) <= MAX_TILT
        assert MIN_THRUST <= control[3] <= MAX_THRUST
    else:
        assert control == wild


@given(YAW, REGULAR)
def test_in_a_corner_the_vehicle_has_the_braking_of_all_axes_at_once(yaw, regular):
    speed = (1.5, 1.5, 2.0)
    position = tuple(high - 0.1 for high in UPPER)
    control, priority = hovering(yaw).control(0.0, position, speed, yaw, regular)
    assert priority == 1.0
    done = coupled_acceleration(control, yaw)
    # The regular control may brake even more.
    assert np.all(np.array(done) <= np.array([-1.4, -1.4, -2.0]) + 1e-6)


def test_what_the_limits_leave_is_counted_together():
    vertical = 2.0
    most = max_horizontal_braking(vertical)
    # Both tilts at their limit, at 45 degrees to the axes, with the least thrust.
    thrust = GRAVITY - vertical
    along = coupled_acceleration([0.0, MAX_TILT, 0.0, thrust], math.pi / 4.0)
    assert along[:2] == pytest.approx([most, most])
    # With tilt, the thrust lifts less.
    up = coupled_acceleration([MAX_TILT, MAX_TILT, 0.0, 14.0], 0.0)[2]
    assert max_vertical_braking(14.0) == pytest.approx(up)


@pytest.mark.parametrize("name", TYPES)
def test_a_type_has_the_thrust_to_brake_with_that_a_loaded_battery_leaves(name):
    most = bounds.max_thrust(name)
    assert max_vertical_braking(most) > 2.0
    rotors = GRAVITY * (TYPES[name].max_rotor_speed / TYPES[name].hover_speed) ** 2
    assert most < 0.83 * rotors


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_vehicle_outside_comes_back_slowly_and_stays(axis, side):
    position = list(MIDDLE)
    position[axis] = (UPPER if side > 0 else LOWER)[axis] + side * 2.0
    flight = Flight(position=position)
    positions = flight.fly(lambda t: HOVER, 8.0)[:, axis]
    speeds = np.abs(np.diff(positions)) / PERIOD
    assert speeds.max() < 0.75
    assert LOWER[axis] < positions[-1] < UPPER[axis]
    others = [each for each in range(3) if each != axis]
    assert flight.position[others] == pytest.approx(np.array(MIDDLE)[others], abs=1e-6)


def test_pressed_against_a_wall_it_stays_within_3_cm_and_slides_along_it():
    flight = Flight()
    flight.fly(lambda t: control_of((2.0, 0.0, 0.0), 0.0), 6.0)
    before = flight.position.copy()
    path = flight.fly(lambda t: control_of((2.0, 0.1, 0.0), 0.0), 2.0)
    assert 0.0 < UPPER[0] - path[:, 0].max()
    assert UPPER[0] - path[:, 0].min() < 0.03
    # 0.1 m/s^2 for 2 s along the wall, later by lag, delay and a period.
    assert path[-1, 1] - before[1] == pytest.approx(0.1 * 1.85**2 / 2.0, abs=0.01)
    assert path[-1, 2] == pytest.approx(before[2], abs=1e-3)


@pytest.mark.parametrize("up", [3.0, -3.0])
def test_pressed_against_ceiling_or_floor_it_stays_within_3_cm(up):
    flight = Flight()
    flight.fly(lambda t: control_of((0.0, 0.0, up), 0.0), 6.0)
    heights = flight.fly(lambda t: control_of((0.0, 0.0, up), 0.0), 2.0)[:, 2]
    room = UPPER[2] - heights if up > 0.0 else heights - LOWER[2]
    assert room.min() > 0.0
    assert room.max() < 0.03


def test_near_a_wall_a_control_that_is_safe_is_passed_bit_for_bit():
    position = (UPPER[0] - 0.05, 0.1, 1.4)
    control, priority = hovering().control(0.0, position, AT_REST, 0.0, HOVER)
    # The next one, which may come before the fence's answer to it, need not be.
    assert (control, priority) == (HOVER, 1.0)


def test_near_a_wall_a_thrust_that_is_safe_is_passed_whatever_the_battery_leaves():
    """Only the fence's own controls ask for less: a climb beside a wall is the regular one's."""
    made = Geofence(LOWER, UPPER, AXES, max_thrust=12.7)
    climb = (0.0, 0.0, 0.3, 15.0)
    for k in range(100):
        made.sent(-1.0 + k * PERIOD, HOVER, 0.0)
    beside = (UPPER[0] - 0.05, 0.1, LOWER[2] + 0.3)
    assert made.control(0.0, beside, AT_REST, 0.0, climb) == (climb, 1.0)
    # What it changes has no more than that.
    faster = (0.3, 0.0, 0.0)
    control, _ = made.control(PERIOD, beside, faster, 0.0, (0.0, 0.2, 0.3, 15.0))
    assert control[3] <= 12.7


def test_a_clock_that_steps_back_leaves_it_at_work():
    position, velocity = (UPPER[0] - 0.3, 0.1, 1.4), (1.5, 0.0, 0.0)
    before = hovering().control(0.0, position, velocity, 0.0, HOVER)
    made = hovering()
    for k in range(3):
        made.sent(90.0 + k * PERIOD, HOVER, 0.0)
        made.control(90.0 + k * PERIOD, MIDDLE, AT_REST, 0.0, HOVER)
    made.sent(0.0, HOVER, 0.0)
    assert made.control(0.0, position, velocity, 0.0, HOVER) == before


def test_it_does_not_chatter_at_the_wall():
    flight = Flight()
    flight.fly(lambda t: control_of((2.0, 0.0, 0.0), 0.0), 6.0)
    flight.fly(lambda t: control_of((2.0, 0.0, 0.0), 0.0), 2.0)
    pitch = np.array(flight.controls)[-200:, 1]
    assert np.abs(np.diff(pitch)).max() < 0.01


class Flight:
    """The vehicle of the theorem in three axes, its fence, and a merger that is a period late.

    The merger is that of the C++ workspace: it answers each regular control with (1 - p) of it and
    p of the prioritised one, the last that has come.

    Errors, disturbance and lateness are drawn from ``draw`` (between -1 and 1), in units of bounds.
    """

    def __init__(self, axes=AXES, position=MIDDLE, yaw=0.0, draw=lambda: 0.0):
        self.axes, self.yaw, self.draw = axes, yaw, draw
        self.fence = Geofence(LOWER, UPPER, axes)
        self.position, self.velocity = np.array(position, dtype=float), np.zeros(3)
        self.acceleration = np.zeros(3)
        self.time, self.prior = 0.0, (HOVER, 0.0)
        delay = round(axes[0].delay / PERIOD)
        self.pending = [HOVER] * delay
        self.controls = []

    def fly(self, regular, duration):
        path = []
        for _ in range(round(duration / PERIOD)):
            self.step(regular(self.time))
            path.append(self.position.copy())
        return np.array(path)

    def step(self, regular):
        measured = [
            tuple(
                float(x + self.draw() * getattr(a, name))
                for x, a in zip(xs, self.axes, strict=True)
            )
            for xs, name in (
                (self.position, "position_error"),
                (self.velocity, "velocity_error"),
            )
        ]
        control, p = self.prior
        final = tuple((1.0 - p) * r + p * c for r, c in zip(regular, control, strict=True))
        assert final == (control if p else regular)
        self.prior = self.fence.control(self.time, *measured, self.yaw, regular)
        self.fence.sent(self.time, final, self.yaw)
        self.pending.append(final)
        control = self.pending.pop(0)
        self.controls.append(control)
        u = np.array(coupled_acceleration(control, self.yaw))
        sure = [axis.braking for axis in self.axes]
        certain = np.clip(u, np.negative(sure), sure)
        # Of what is not certain, all is there, or nothing.
        u = certain + (1.0 + self.draw()) / 2.0 * (u - certain)
        d = np.array([self.draw() * axis.disturbance for axis in self.axes])
        state = zip(self.position, self.velocity, self.acceleration, u, d, strict=True)
        responses = [response(PERIOD, axis.tau) for axis in self.axes]
        moves = [r.moved(*each) for r, each in zip(responses, state, strict=True)]
        self.position, self.velocity, self.acceleration = np.array(moves).T
        self.time += PERIOD


@given(
    st.lists(st.tuples(REGULAR, st.integers(1, 120)), min_size=1, max_size=5), YAW, st.booleans()
)
def test_no_program_of_controls_leads_out(program, yaw, is_steady):
    """Bounds at their worst: errors and disturbance jump between their limits, or stay there."""
    source = random.Random(1)
    sign = 1.0 if is_steady else None
    flight = Flight(yaw=yaw, draw=lambda: sign or source.choice([-1.0, 1.0]))
    for regular, periods in program:
        path = flight.fly(lambda t, regular=regular: regular, periods * PERIOD)
        assert np.all(path < UPPER)
        assert np.all(path > LOWER)


def test_a_disturbance_beyond_its_bound_is_seen_and_widens_it():
    flight = Flight(draw=lambda: 0.0)
    flight.fly(lambda t: HOVER, 1.0)
    assert flight.fence.excess() == []
    before = flight.fence.control(flight.time, (1.2, 0.1, 1.4), AT_REST, 0.0, HOVER)
    flight.fence.sent(flight.time, HOVER, 0.0)
    # A wind of 0.9 m/s^2 along x, which the regular controller leans against.
    for _ in range(100):
        flight.velocity[0] += 0.9 * PERIOD
        flight.step((0.0, -0.0917, 0.0, GRAVITY / math.cos(0.0917)))
    [(name, seen, bound)] = flight.fence.excess()
    assert (name, bound) == ("x", AXES[0].disturbance)
    assert 0.6 < seen < 1.0
    # What is certain is without the errors of both velocities.
    assert seen == pytest.approx(0.9 - 2.0 * AXES[0].velocity_error / 0.5, abs=0.1)
    assert before[1] == 0.0


def test_a_vehicle_on_the_ground_shows_no_disturbance():
    made = fence()
    for k in range(300):
        made.sent(k * PERIOD, (0.0, 0.0, 0.0, 0.0), 0.0)
        made.control(k * PERIOD, (0.0, 0.0, 0.0), AT_REST, 0.0, HOVER)
    assert made.excess() == []
