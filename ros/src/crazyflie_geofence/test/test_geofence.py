"""The geofence: its algorithm."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from crazyflie_control_merger.merging import MERGE, Merger
from crazyflie_geofence.geofence import (
    MAX_HORIZONTAL,
    MAX_HORIZONTAL_BRAKING,
    Geofence,
    acceleration_from_control,
    control_from_acceleration,
)
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_model.units import GRAVITY

LOWER, UPPER = np.array([-1.5, -1.0, 0.3]), np.array([1.5, 1.2, 2.5])
MARGIN, RATE = 0.5, 1.0
HORIZONTAL, VERTICAL = (1.5, 0.4), (4.0, 0.2)
FENCE = Geofence(LOWER, UPPER, MARGIN, HORIZONTAL, VERTICAL, RATE)
MIDDLE = (LOWER + UPPER) / 2.0
HOVER = np.array([0.0, 0.0, 0.0, GRAVITY])
PERIOD = 0.01

UNIT = st.floats(-1.0, 1.0)
VECTOR = st.tuples(UNIT, UNIT, UNIT).map(np.array)
YAW = st.floats(-math.pi, math.pi)
REGULAR = st.tuples(UNIT, UNIT, UNIT, UNIT).map(
    lambda u: np.array([u[0] * MAX_TILT, u[1] * MAX_TILT, u[2], 10.0 + 6.0 * u[3]])
)


def inside(unit):
    """Return a point of the box for coordinates in [-1, 1]."""
    return MIDDLE + unit * (UPPER - LOWER) / 2.0


@pytest.mark.parametrize(("axis", "braking"), [(0, HORIZONTAL), (1, HORIZONTAL), (2, VERTICAL)])
@pytest.mark.parametrize("speed", [-3.0, -0.2, 0.0, 1.0, 2.5])
def test_stopping_point_is_where_a_braking_vehicle_stops(axis, braking, speed):
    velocity = speed * np.eye(3)[axis]
    direction = math.copysign(1.0, speed)

    def rates(t, x):
        deceleration = braking[0] if t >= braking[1] else 0.0
        return [x[1], -direction * deceleration]

    end = braking[1] + abs(speed) / braking[0]
    solution = solve_ivp(rates, (0.0, end), [MIDDLE[axis], speed], max_step=1e-3)
    expected = MIDDLE.copy()
    expected[axis] = solution.y[0, -1]
    np.testing.assert_allclose(FENCE.stopping_point(MIDDLE, velocity), expected, atol=2e-3)


@pytest.mark.parametrize(("axis", "sign"), [(0, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)])
@pytest.mark.parametrize("speed", [0.0, 0.5])
def test_the_fence_alone_brings_the_stopping_point_back_exponentially(axis, sign, speed):
    wall = UPPER[axis] if sign > 0.0 else LOWER[axis]

    def states(x):
        position, velocity = MIDDLE.copy(), np.zeros(3)
        position[axis], velocity[axis] = x
        return position, velocity

    def rates(t, x):
        position, velocity = states(x)
        excess = FENCE.excess(position, velocity)
        return [x[1], FENCE.acceleration(velocity, excess)[axis]]

    # The stopping point begins on the wall.
    braking = VERTICAL if axis == 2 else HORIZONTAL
    distance = speed * braking[1] + speed**2 / (2.0 * braking[0])
    start = [wall - sign * distance, sign * speed]
    times = np.linspace(0.0, 3.0, 31)
    solution = solve_ivp(rates, (0.0, 3.0), start, t_eval=times, rtol=1e-8, atol=1e-10)
    excess = [FENCE.excess(*states(x))[axis] for x in solution.y.T]
    np.testing.assert_allclose(excess, sign * MARGIN * np.exp(-RATE * times), atol=1e-6)


def at_stopping_point(stop, velocity):
    """Return the position from which a vehicle comes to rest at ``stop``."""
    return stop - (FENCE.stopping_point(np.zeros(3), velocity))


@given(VECTOR, VECTOR, YAW, REGULAR)
def test_no_weight_while_the_stopping_point_is_in_the_inner_box(unit, velocity, yaw, regular):
    stop = MIDDLE + unit * ((UPPER - LOWER) / 2.0 - MARGIN)
    position = at_stopping_point(stop, velocity)
    control, priority = FENCE.control(position, velocity, yaw, regular)
    # A stopping point on the inner box is outside by a rounding error.
    assert priority < 1e-12
    np.testing.assert_allclose((1.0 - priority) * regular + priority * control, regular, atol=1e-9)


@given(YAW, REGULAR)
def test_agrees_with_the_regular_controller_in_the_middle(yaw, regular):
    regular[3] = max(regular[3], MIN_THRUST)
    control, priority = FENCE.control(MIDDLE, np.zeros(3), yaw, regular)
    assert priority == 0.0
    np.testing.assert_allclose(control, regular, atol=1e-9)


@given(VECTOR, VECTOR, st.integers(0, 2), st.floats(1.0, 3.0), st.sampled_from([-1.0, 1.0]))
def test_full_weight_where_the_stopping_point_is_outside(unit, velocity, axis, beyond, sign):
    unit[axis] = sign * beyond
    position = at_stopping_point(inside(unit), velocity)
    _, priority = FENCE.control(position, velocity, 0.0, HOVER)
    assert priority == pytest.approx(1.0)


@given(VECTOR, VECTOR, VECTOR)
def test_the_weight_is_smooth(unit, velocity, step):
    position = inside(unit)
    excess = FENCE.excess(position, velocity)
    other = FENCE.excess(position + 0.01 * step, velocity)
    change = np.abs(FENCE.weight(other) - FENCE.weight(excess))
    assert np.all(change <= 1.5 / MARGIN * np.abs(other - excess) + 1e-12)


@given(st.floats(0.0, 1.0), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_the_weight_grows_with_the_speed_towards_the_wall(x, slow, more):
    position = MIDDLE + [x, 0.0, 0.0]
    weights = [
        FENCE.weight(FENCE.excess(position, np.array([speed, 0.0, 0.0])))[0]
        for speed in (slow, slow + more)
    ]
    assert weights[0] <= weights[1]


@given(VECTOR, VECTOR, YAW, REGULAR)
def test_each_axis_is_mixed_by_its_own_weight(unit, velocity, yaw, regular):
    position = inside(unit)
    regular[3] = max(regular[3], MIN_THRUST)
    control, priority = FENCE.control(position, velocity, yaw, regular)
    assert control[2] == regular[2]
    assume(np.all(np.abs(control[:2]) < MAX_TILT) and MIN_THRUST < control[3] < MAX_THRUST)
    excess = FENCE.excess(position, velocity)
    wanted = acceleration_from_control(regular, yaw)
    mixed = priority * acceleration_from_control(control, yaw) + (1.0 - priority) * wanted
    weight = FENCE.weight(excess)
    by_axis = weight * FENCE.acceleration(velocity, excess) + (1.0 - weight) * wanted
    np.testing.assert_allclose(mixed, by_axis, atol=1e-9)


def test_a_wall_ahead_does_not_keep_the_vehicle_from_moving_along_it():
    position = np.array([1.45, 0.0, 1.4])
    regular = np.array([0.2, 0.2, 0.3, 12.0])
    control, priority = FENCE.control(position, np.zeros(3), 0.0, regular)
    assert priority > 0.9
    assert control[1] < -0.05
    forwards, back = regular.copy(), control.copy()
    forwards[1] = back[1] = 0.0
    assert back[[0, 2]] == pytest.approx(forwards[[0, 2]])
    lift = acceleration_from_control(control, 0.0)[2], acceleration_from_control(regular, 0.0)[2]
    assert lift[0] == pytest.approx(lift[1])


@given(VECTOR, VECTOR, YAW, YAW)
def test_the_same_push_at_every_heading(unit, velocity, yaw, other):
    position = inside(unit)
    pushes = []
    for heading in (yaw, other):
        excess = FENCE.excess(position, velocity)
        acceleration = np.clip(FENCE.acceleration(velocity, excess), -1.5, 1.5)
        control = control_from_acceleration(acceleration, heading, 0.0)
        pushes.append(acceleration_from_control(control, heading))
    np.testing.assert_allclose(pushes[0], pushes[1], atol=1e-9)


@given(st.tuples(UNIT, UNIT, UNIT), YAW)
def test_control_and_acceleration_are_inverse(unit, yaw):
    acceleration = np.multiply(unit, [1.8, 1.8, 4.0])
    back = acceleration_from_control(control_from_acceleration(acceleration, yaw, 0.1), yaw)
    np.testing.assert_allclose(back, acceleration, atol=1e-9)


# With the nose along x, y, -x and -y of the fixed frame: forward is positive pitch, to the right
# positive roll, each by atan(1.5 / g).
TILT = 0.15173
HEADINGS = [
    (0.0, (0.0, TILT), (-TILT, 0.0)),
    (math.pi / 2.0, (TILT, 0.0), (0.0, TILT)),
    (math.pi, (0.0, -TILT), (TILT, 0.0)),
    (-math.pi / 2.0, (-TILT, 0.0), (0.0, -TILT)),
]


@pytest.mark.parametrize(("yaw", "along_x", "along_y"), HEADINGS)
def test_tilts_to_where_it_accelerates_at_any_heading(yaw, along_x, along_y):
    for acceleration, tilt in (((1.5, 0.0, 0.0), along_x), ((0.0, 1.5, 0.0), along_y)):
        control = control_from_acceleration(np.array(acceleration), yaw, 0.0)
        assert control[:2] == pytest.approx(tilt, abs=1e-5)
        thrust = GRAVITY / math.cos(TILT)
        back = acceleration_from_control(np.array([*tilt, 0.0, thrust]), yaw)
        assert back == pytest.approx(acceleration, abs=1e-4)


@given(VECTOR, VECTOR, YAW, REGULAR)
def test_control_is_within_limits(unit, velocity, yaw, regular):
    control, _ = FENCE.control(5.0 * inside(unit), 20.0 * velocity, yaw, 3.0 * regular)
    assert np.all(np.abs(control[:2]) <= MAX_TILT)
    assert MIN_THRUST <= control[3] <= MAX_THRUST


def test_braking_can_be_had_in_a_corner():
    far = UPPER + 10.0
    acceleration = FENCE.acceleration(np.zeros(3), FENCE.excess(far, np.zeros(3)))
    assert math.hypot(*acceleration[:2]) == pytest.approx(MAX_HORIZONTAL)
    assert np.max(acceleration[:2]) <= -MAX_HORIZONTAL_BRAKING * 0.99


@given(
    VECTOR,
    st.lists(st.tuples(REGULAR, st.integers(1, 150)), min_size=1, max_size=6),
    YAW,
)
def test_a_point_mass_never_leaves_whatever_the_regular_controller_does(unit, program, yaw):
    position = MIDDLE + unit * ((UPPER - LOWER) / 2.0 - MARGIN)
    velocity = np.zeros(3)
    merger = Merger()
    time = 0.0
    for regular, periods in program:
        for _ in range(periods):
            time += PERIOD
            merger.prioritize(*FENCE.control(position, velocity, yaw, regular), time)
            acceleration = acceleration_from_control(merger.merged(regular, time, MERGE), yaw)
            position = position + PERIOD * (velocity + PERIOD * acceleration / 2.0)
            velocity = velocity + PERIOD * acceleration
            assert np.all((position > LOWER) & (position < UPPER))
