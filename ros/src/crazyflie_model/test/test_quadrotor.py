"""The airframe against closed forms, conservation laws and scipy's integrator."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from crazyflie_model.elementwise import join, split
from crazyflie_model.limits import FULL_PWM
from crazyflie_model.quadrotor import CRAZYFLIE
from crazyflie_model.stabilized_quadrotor import Airframe
from crazyflie_model.units import GRAVITY, HOVER_PWM

AIRFRAME = Airframe(CRAZYFLIE)
STILL_AIR = (0.0, 0.0, 0.0)
INERTIA = np.diag([CRAZYFLIE.inertia_x, CRAZYFLIE.inertia_y, CRAZYFLIE.inertia_z])

UNITS = st.floats(-1.0, 1.0)
QUATERNIONS = (
    st.tuples(UNITS, UNITS, UNITS, UNITS)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)


def state(
    position=(0, 0, 10), velocity=(0, 0, 0), quaternion=(0, 0, 0, 1), rates=(0, 0, 0), speeds=0.0
):
    """Return a state as an array; ``speeds`` is for each rotor or for all."""
    parts = [position, velocity, quaternion, rates, np.broadcast_to(speeds, 4)]
    return np.concatenate(parts, dtype=float)


def flown(x, speeds, duration, wind=STILL_AIR, airframe=AIRFRAME):
    """Return the state with constant commands after a time in steps of 1 ms."""
    x, speeds = split(x), split(np.broadcast_to(speeds, 4))
    for k in range(round(duration / 0.001)):
        x = airframe.step(0.001 * k, x, speeds, wind, 0.001)
    return join(x)


def random_state(rng):
    quaternion = rng.normal(size=4)
    return state(
        rng.uniform(50, 60, 3),
        rng.normal(size=3),
        quaternion / np.linalg.norm(quaternion),
        rng.normal(size=3) * 5.0,
        rng.uniform(500, 2000, 4),
    )


def test_hover_is_an_equilibrium():
    x = state(speeds=CRAZYFLIE.hover_speed)
    np.testing.assert_allclose(flown(x, CRAZYFLIE.hover_speed, 5.0), x, atol=1e-9)
    thrust, *torque = AIRFRAME.wrench([CRAZYFLIE.hover_speed] * 4)
    assert thrust == pytest.approx(0.027 * 9.81)
    np.testing.assert_allclose(torque, 0.0, atol=1e-12)


def test_without_rotors_it_falls_freely():
    x = flown(state(velocity=(1.0, -2.0, 3.0)), 0.0, 1.0)
    expected = [1.0, -2.0, 13.0 - GRAVITY / 2, 1.0, -2.0, 3.0 - GRAVITY]
    np.testing.assert_allclose(x[:6], expected, atol=1e-9)


def test_motors_lag():
    x = flown(state(speeds=1000.0), 2000.0, 0.1)
    decay = math.exp(-0.1 / CRAZYFLIE.motor_time_constant)
    np.testing.assert_allclose(x[13:], 2000.0 - 1000.0 * decay, rtol=1e-9)
    assert CRAZYFLIE.motor_time_constant == pytest.approx(0.0647, abs=1e-4)


def test_motors_have_limits():
    assert flown(state(), 9999.0, 1.0)[13:] == pytest.approx([CRAZYFLIE.max_rotor_speed] * 4)
    assert flown(state(speeds=100.0), -500.0, 1.0)[13:] == pytest.approx([0.0] * 4, abs=1e-4)


def test_terminal_velocity_with_the_rotors_turning_slowly():
    speed = 1000.0
    x = flown(state(position=(0, 0, 500), speeds=speed), speed, 5.0)
    drag = CRAZYFLIE.drag_vertical * 4.0 * speed
    excess = CRAZYFLIE.mass * GRAVITY - 4.0 * CRAZYFLIE.thrust_constant * speed**2
    settled = 1.0 - math.exp(-5.0 * drag / CRAZYFLIE.mass)
    assert x[5] == pytest.approx(-excess / drag * settled, rel=1e-9)


def test_wind_carries_it_along():
    x = flown(state(speeds=CRAZYFLIE.hover_speed), CRAZYFLIE.hover_speed, 3.0, (2.0, -1.0, 0.0))
    decay = math.exp(
        -3.0 * CRAZYFLIE.drag_horizontal * 4.0 * CRAZYFLIE.hover_speed / CRAZYFLIE.mass
    )
    np.testing.assert_allclose(x[3:6], np.array([2.0, -1.0, 0.0]) * (1.0 - decay), rtol=1e-9)


@pytest.mark.parametrize(
    ("faster", "signs"),
    [(0, (-1, -1, -1)), (1, (-1, 1, 1)), (2, (1, 1, -1)), (3, (1, -1, 1))],
    ids=["front right", "back right", "back left", "front left"],
)
def test_signs_of_the_torque_of_each_rotor(faster, signs):
    speeds = np.zeros(4)
    speeds[faster] = 1000.0
    _, *torque = AIRFRAME.wrench(speeds)
    np.testing.assert_array_equal(np.sign(torque), signs)
    force = CRAZYFLIE.thrust_constant * 1000.0**2
    lever = 0.046 / math.sqrt(2.0)
    np.testing.assert_allclose(np.abs(torque), [force * lever, force * lever, 0.005964552 * force])


def test_gyroscopic_torque():
    # Euler's equations without torque: I dw/dt = -w x I w.
    rates = np.array([3.0, -2.0, 5.0])
    x_dot = join(AIRFRAME.rates(0.0, split(state(rates=rates)), [0.0] * 7))
    np.testing.assert_allclose(INERTIA @ x_dot[10:13], -np.cross(rates, INERTIA @ rates))


@given(quaternion=QUATERNIONS, wind=st.tuples(UNITS, UNITS, UNITS))
def test_force_against_rotation_matrices(quaternion, wind):
    velocity, speeds = np.array([1.0, -2.0, 0.5]), np.array([1500.0, 1400.0, 1600.0, 1550.0])
    x_dot = AIRFRAME.rates(
        0.0,
        split(state(velocity=velocity, quaternion=quaternion, speeds=speeds)),
        [0.0] * 4 + [*wind],
    )
    rotation = Rotation.from_quat(quaternion).as_matrix()
    drag = np.diag([CRAZYFLIE.drag_horizontal] * 2 + [CRAZYFLIE.drag_vertical]) * speeds.sum()
    force = [0, 0, CRAZYFLIE.thrust_constant * (speeds**2).sum()] - drag @ rotation.T @ (
        velocity - wind
    )
    np.testing.assert_allclose(
        x_dot[3:6], rotation @ force / CRAZYFLIE.mass - [0, 0, GRAVITY], atol=1e-12
    )


def test_tumbling_conserves_energy_and_angular_momentum():
    x = random_state(np.random.default_rng(4))
    x[13:] = 0.0

    def conserved(x):
        rates = x[10:13]
        energy = CRAZYFLIE.mass * (x[3:6] @ x[3:6] / 2.0 + GRAVITY * x[2])
        momentum = Rotation.from_quat(x[6:10]).apply(INERTIA @ rates)
        return np.array([energy, rates @ INERTIA @ rates / 2.0, *momentum])

    np.testing.assert_allclose(conserved(flown(x, 0.0, 2.0)), conserved(x), rtol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_agrees_with_scipy(seed):
    rng = np.random.default_rng(seed)
    x, speeds, wind = random_state(rng), rng.uniform(1450, 1550, 4), rng.normal(size=3)
    solution = solve_ivp(
        lambda t, x: AIRFRAME.rates(t, x, [*speeds, *wind]),
        (0.0, 1.0),
        x,
        method="DOP853",
        rtol=1e-11,
        atol=1e-11,
    )
    np.testing.assert_allclose(
        flown(x, speeds, 1.0, tuple(wind)), solution.y[:, -1], rtol=1e-7, atol=1e-7
    )


@given(
    quaternion=QUATERNIONS,
    rates=st.tuples(*[st.floats(-30.0, 30.0)] * 3),
    speeds=st.tuples(*[st.floats(0.0, 2200.0)] * 4),
)
def test_the_quaternion_keeps_its_norm(quaternion, rates, speeds):
    x = flown(state(quaternion=quaternion, rates=rates, speeds=speeds), speeds, 0.05)
    assert np.linalg.norm(x[6:10]) == pytest.approx(1.0, abs=1e-14)


@given(quaternion=QUATERNIONS, fall=st.floats(0.0, 5.0))
@example(quaternion=(0.0, 1.0, 5e-324, 5e-324), fall=0.0)
def test_on_the_ground_it_stands_upright_and_keeps_its_heading(quaternion, fall):
    before = state((1, 2, -0.01), (1, 1, -fall), quaternion, (1, 2, 3), 500.0)
    x = join(AIRFRAME.apply_ground_contact(split(before)))
    np.testing.assert_array_equal(x[[0, 1, 2, 3, 4, 5, 6, 7, 10, 11, 12]], [1, 2] + [0] * 9)
    np.testing.assert_array_equal(x[13:], 500.0)
    assert np.hypot(*x[8:10]) == pytest.approx(1.0)
    if np.hypot(*quaternion[2:]) > 1e-3:
        # The rotation left over is about an axis in the ground: upright by the shortest way.
        rest = Rotation.from_quat(quaternion) * Rotation.from_quat(x[6:10]).inv()
        assert rest.as_quat()[2] == pytest.approx(0.0, abs=1e-9)


def test_upside_down_on_the_ground_heading_is_lost():
    x = AIRFRAME.apply_ground_contact(split(state((0, 0, -1), quaternion=(1, 0, 0, 0))))
    assert x[6:10] == [0.0, 0.0, 0.0, 1.0]


def test_batches_fly_like_single_vehicles():
    rng = np.random.default_rng(6)
    x = np.array([random_state(rng) for _ in range(5)])
    x[3:, 2] = [-0.1, 0.0]
    commands = rng.uniform(0.0, 2500.0, (5, 4))
    singly = [
        join(AIRFRAME.step(0.0, split(xi), split(ci), STILL_AIR, 0.001))
        for xi, ci in zip(x, commands, strict=True)
    ]
    batch = join(AIRFRAME.step(0.0, split(x), split(commands), STILL_AIR, 0.001))
    np.testing.assert_allclose(batch, singly, rtol=1e-12, atol=1e-15)


def test_parameters_cannot_be_changed_by_accident():
    with pytest.raises(dataclasses.FrozenInstanceError):
        CRAZYFLIE.mass = 1.0


def test_motor_commands_are_thrust():
    assert CRAZYFLIE.rotor_speed(HOVER_PWM) == pytest.approx(CRAZYFLIE.hover_speed)
    speeds = CRAZYFLIE.rotor_speed(np.array([0.0, 0.25 * HOVER_PWM, HOVER_PWM]))
    np.testing.assert_allclose(speeds, CRAZYFLIE.hover_speed * np.array([0.0, 0.5, 1.0]))


@pytest.mark.parametrize("curve", [(0.2, -0.09), (0.05, 0.1), (0.2, 0.0)])
def test_a_thrust_that_no_command_makes_asks_for_more_than_a_full_one(curve):
    model = dataclasses.replace(CRAZYFLIE, mass=0.033).with_thrust_curve(*curve)
    full = model.thrust(FULL_PWM)
    thrusts = [0.5 * full, full, full + 0.01, full + 5.0, 1e3]
    commands = [model.pwm(thrust) for thrust in thrusts]
    assert [model.thrust(command) for command in commands[:2]] == pytest.approx(thrusts[:2])
    assert commands[1] == pytest.approx(FULL_PWM)
    assert commands == sorted(commands)
    assert model.pwm(np.array(thrusts)) == pytest.approx(commands)


def test_a_vehicle_with_errors_hovers_with_other_thrust():
    other = CRAZYFLIE.with_errors(0.1, -0.05)
    thrust = 4.0 * other.thrust_constant * CRAZYFLIE.hover_speed**2 / other.mass
    assert thrust == pytest.approx(GRAVITY * 0.95 / 1.1)


def test_at_the_beginning_rotors_turn_in_the_air_only():
    level = [0.0] * 6 + [1.0] + [0.0] * 3
    hover = CRAZYFLIE.hover_speed
    assert AIRFRAME.initial_state((1.0, 2.0, 0.5)) == [1.0, 2.0, 0.5, *level, *[hover] * 4]
    assert AIRFRAME.initial_state((1.0, 2.0, 0.0)) == [1.0, 2.0, 0.0, *level, *[0.0] * 4]


@pytest.mark.parametrize("z", [0.0, -0.01])
def test_what_climbs_leaves_the_ground_and_what_sinks_does_not(z):
    rates, tilted = (1.0, 2.0, 3.0), (0.6, 0.0, 0.0, 0.8)
    climbing = AIRFRAME.apply_ground_contact(split(state((1, 2, z), (1, 1, 0.7), tilted, rates)))
    assert climbing == [1.0, 2.0, 0.0, 0.0, 0.0, 0.7, 0.0, 0.0, 0.0, 1.0] + [0.0] * 7
    sinking = AIRFRAME.apply_ground_contact(split(state((1, 2, z), (1, 1, -0.7), tilted, rates)))
    assert sinking[:6] == [1.0, 2.0, 0.0, 0.0, 0.0, 0.0]
