"""The control laws against matrices that are multiplied out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from crazyflie_lqr.linear_feedback import (
    IntegralStateFeedback,
    LinearFeedback,
    heading_error,
    integrate,
)
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST

U_REF = np.array([0.0, 0.0, 0.0, 9.81])
GENTLE = 0.001 * np.arange(1.0, 29.0).reshape(4, 7)
states = arrays(float, 7, elements=st.floats(-20.0, 20.0))


def integral(k=(0.0, 0.0, 0.0), limit=(0.0, 0.0, 0.0), K=GENTLE):
    """Return an integral state feedback."""
    return IntegralStateFeedback(K, U_REF, 6, k, limit)


def state(**values):
    """Return a state with these entries."""
    names = ["x", "y", "z", "x_dot", "y_dot", "z_dot", "yaw"]
    return np.array([values.get(name, 0.0) for name in names])


@given(states, states)
def test_the_error_is_turned_into_the_heading_frame(x, x_ref):
    c, s = math.cos(x[6]), math.sin(x[6])
    to_heading = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    turned = np.zeros((7, 7))
    turned[:3, :3] = turned[3:6, 3:6] = to_heading
    expected = turned @ (x - x_ref)
    error = heading_error(x, x_ref, 6)
    np.testing.assert_allclose(error[:6], expected[:6], atol=1e-12)
    assert abs(error[6]) <= math.pi + 1e-12
    assert math.cos(error[6] - (x[6] - x_ref[6])) == pytest.approx(1.0)


def test_north_of_the_reference_and_looking_north_is_ahead_of_it():
    error = heading_error(state(y=2.0, x_dot=1.0, yaw=math.pi / 2.0), np.zeros(7), 6)
    np.testing.assert_allclose(error, state(x=2.0, y_dot=-1.0, yaw=math.pi / 2.0), atol=1e-12)


@given(states, states)
def test_inputs_are_left_alone(x, x_ref):
    before = x.copy(), x_ref.copy()
    integral(limit=(1.0, 1.0, 1.0)).control(x, x_ref, 0.0)
    np.testing.assert_array_equal(before, (x, x_ref))


def test_yaw_may_be_anywhere_in_the_state():
    x = np.zeros(12)
    x[[0, 8]] = 1.0, math.pi / 2.0
    error = heading_error(x, np.zeros(12), 8)
    assert error[1] == pytest.approx(-1.0)
    assert error[8] == pytest.approx(math.pi / 2.0)


@given(states, states)
def test_linear_feedback_is_k_times_the_error(x, x_ref):
    u = LinearFeedback(GENTLE, U_REF, 6).control(x, x_ref, 0.0)
    np.testing.assert_allclose(u, U_REF + GENTLE @ heading_error(x, x_ref, 6))


def test_gains_and_hover_may_be_set_later():
    x = state(x=1.0, z=2.0, x_dot=0.3)
    later, gentle = LinearFeedback(10.0 * GENTLE, 0.5 * U_REF, 6), LinearFeedback(GENTLE, U_REF, 6)
    later.K, later.u_ref = GENTLE, U_REF
    np.testing.assert_array_equal(
        later.control(x, np.zeros(7), 0.0), gentle.control(x, np.zeros(7), 0.0)
    )


@given(states, st.floats(-1.0, 1.0))
def test_a_quarter_turn_of_the_world_does_not_change_the_control(x, yaw):
    x[6] = yaw
    turned = np.array([-x[1], x[0], x[2], -x[4], x[3], x[5], yaw + math.pi / 2.0])
    feedback = LinearFeedback(GENTLE, U_REF, 6)
    np.testing.assert_allclose(
        feedback.control(turned, state(yaw=math.pi / 2.0), 0.0),
        feedback.control(x, np.zeros(7), 0.0),
        atol=1e-12,
    )


@given(states, states)
def test_integral_state_feedback_is_limited_linear_feedback(x, x_ref):
    K = 100.0 * GENTLE
    u = integral(K=K).control(x, x_ref, 0.0)
    linear = LinearFeedback(K, U_REF, 6).control(x, x_ref, 0.0)
    low = [-MAX_TILT, -MAX_TILT, -math.inf, MIN_THRUST]
    high = [MAX_TILT, MAX_TILT, math.inf, MAX_THRUST]
    np.testing.assert_array_equal(u, np.minimum(np.maximum(linear, low), high))


def test_integrator_acts_on_pitch_roll_and_thrust():
    controller = integral(k=(-0.01, 0.02, -0.3), limit=(9.0, 9.0, 9.0), K=np.zeros((4, 7)))
    x = state(x=1.0, y=2.0, z=3.0)
    for time in np.arange(0.0, 1.05, 0.1):
        u = controller.control(x, np.zeros(7), time)
    np.testing.assert_allclose(u, U_REF + [0.02 * 2.0, -0.01 * 1.0, 0.0, -0.3 * 3.0])


def test_integrator_is_clamped_and_comes_back_at_once():
    controller = integral(k=(0.0, 0.0, 1.0), limit=(0.0, 0.0, 0.5), K=np.zeros((4, 7)))
    for time in np.arange(0.0, 20.0, 0.1):
        u = controller.control(state(z=1.0), np.zeros(7), time)
    assert u[3] == pytest.approx(9.81 + 0.5)
    u = controller.control(state(z=-1.0), np.zeros(7), time + 0.1)
    assert u[3] == pytest.approx(9.81 + 0.4)


@pytest.mark.parametrize("step", [0.0, -0.1, -100.0, 0.51, 3600.0])
def test_integrator_skips_time_that_cannot_be(step):
    controller = integral(k=(0.0, 0.0, 1.0), limit=(0.0, 0.0, 5.0), K=np.zeros((4, 7)))
    for time in (10.0, 10.1, 10.1 + step):
        u = controller.control(state(z=1.0), np.zeros(7), time)
    assert u[3] == pytest.approx(9.81 + 0.1)
    u = controller.control(state(z=1.0), np.zeros(7), 10.1 + step + 0.1)
    assert u[3] == pytest.approx(9.81 + 0.2)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_integrator_forgets_what_overflows():
    controller = integral(k=(0.0, 0.0, 1.0), limit=(1.0, 1.0, 1.0), K=np.zeros((4, 7)))
    for time, x in enumerate([1.7e308, 1.7e308, 0.0]):
        u = controller.control(state(x=x), state(x=-1.7e308 if x else 0.0), 0.1 * time)
    np.testing.assert_allclose(u, U_REF)


def test_integrator_is_off_by_default():
    controller = integral(k=(1.0, 1.0, 1.0))
    for time in (0.0, 0.1, 0.2):
        u = controller.control(state(z=0.1), np.zeros(7), time)
    np.testing.assert_allclose(u, U_REF + GENTLE @ state(z=0.1))


@pytest.mark.parametrize("k", [0.5, -0.5, 4.0])
def test_a_change_of_the_integrator_gain_does_not_make_the_control_jump(k):
    before = integral(k=(0.0, 0.0, 1.0), limit=(0.0, 0.0, 5.0))
    for time in (0.0, 0.1, 0.2):
        u = before.control(state(z=1.0), np.zeros(7), time)
    after = integral(k=(0.0, 0.0, k), limit=(0.0, 0.0, 5.0))
    after.take_over(before)
    np.testing.assert_allclose(after.control(state(z=1.0), np.zeros(7), 0.2), u)
    later = after.control(state(z=1.0), np.zeros(7), 0.3)
    assert later[3] == pytest.approx(u[3] + 0.1 * k)


def test_a_change_keeps_the_integral_within_the_new_limits():
    before = integral(k=(0.0, 0.0, 1.0), limit=(0.0, 0.0, 5.0), K=np.zeros((4, 7)))
    for time in np.arange(0.0, 5.0, 0.1):
        before.control(state(z=1.0), np.zeros(7), time)
    after = integral(k=(0.0, 0.0, 1.0), limit=(0.0, 0.0, 0.5), K=np.zeros((4, 7)))
    after.take_over(before)
    u = after.control(state(), np.zeros(7), time)
    assert u[3] == pytest.approx(9.81 + 0.5)


def test_an_integral_that_had_no_effect_begins_at_zero():
    before = integral(limit=(0.0, 0.0, 5.0), K=np.zeros((4, 7)))
    for time in (0.0, 0.1, 0.2):
        before.control(state(z=1.0), np.zeros(7), time)
    after = integral(k=(0.0, 0.0, 1.0), limit=(0.0, 0.0, 5.0), K=np.zeros((4, 7)))
    after.take_over(before)
    np.testing.assert_allclose(after.control(state(), np.zeros(7), 0.3), U_REF)


# The integral while another control moves the vehicle.


def lifting(k=-1.0, limit=9.0, K=GENTLE):
    return integral(k=(0.0, 0.0, k), limit=(0.0, 0.0, limit), K=K)


def test_on_the_ground_the_integral_is_zero_and_stays_so():
    controller = lifting(K=np.zeros((4, 7)))
    for time in np.arange(0.0, 3.0, 0.1):
        u = controller.control(state(z=-1.0), np.zeros(7), time)
    assert u[3] == pytest.approx(9.81 + 2.9)
    controller.reset_integrator()
    for time in np.arange(3.0, 33.0, 0.1):
        u = controller.control(state(z=-1.0), np.zeros(7), time)
    assert u[3] == 9.81
    controller.enable_integrator()
    u = controller.control(state(z=-1.0), np.zeros(7), time + 0.1)
    assert u[3] == pytest.approx(9.81 + 0.1)


@pytest.mark.parametrize(("axis", "k", "u_index"), [(0, -0.1, 1), (1, 0.1, 0), (2, -1.0, 3)])
def test_the_integral_does_not_grow_into_a_limit(axis, k, u_index):
    gains, limits = np.zeros(3), np.full(3, 100.0)
    gains[axis] = k
    K = np.zeros((4, 7))
    K[u_index, axis] = 20.0 * k
    controller = integral(k=gains, limit=limits, K=K)
    far, near = np.zeros(7), np.zeros(7)
    far[axis], near[axis] = -5.0, 0.1
    for time in np.arange(0.0, 20.0, 0.1):
        controller.control(far, np.zeros(7), time)
    u = controller.control(near, np.zeros(7), time + 0.1)
    # Nothing is left over from the 20 s at the limit.
    expected = 20.0 * k * 0.1 + 0.1 * k * 0.1
    assert u[u_index] - U_REF[u_index] == pytest.approx(expected)


def test_an_integral_at_the_limit_may_shrink():
    controller = integral(k=(0.0, 0.0, -1.0), limit=(0.0, 0.0, 9.0), K=np.zeros((4, 7)))
    for time in np.arange(0.0, 20.0, 0.1):
        controller.control(state(z=-1.0), np.zeros(7), time)
    u = controller.control(state(z=1.0), np.zeros(7), time + 0.1)
    assert 15.7 < u[3] < 16.0
    assert controller.control(state(z=1.0), np.zeros(7), time + 0.2)[3] < u[3]


@pytest.mark.parametrize(("thrust", "sign"), [(2.0 * MAX_THRUST, -1.0), (-MAX_THRUST, 1.0)])
def test_an_integral_that_does_not_cause_the_limit_may_shrink_there(thrust, sign):
    shrunk = integrate(2, 0.5 * sign, -sign, 0.1, [0.0, 0.0, 0.0, thrust], k=-1.0, limit=9.0)
    assert shrunk == pytest.approx(0.4 * sign)


SOFT = np.zeros((4, 7))
SOFT[3, [2, 5]] = -1.5, -1.0


def heights(controller, lift, goal=1.0, duration=20.0, start=0.0):
    """Return the height, 100 a second, of a vehicle whose thrust is ``lift`` times what is asked.

    It takes the control 40 ms late, and the first half second of the takeoff's thrust.
    """
    controller.take_off()
    z, z_dot, late, course = start, 0.0, [10.01] * 4, []
    for time in np.arange(0.0, duration, 0.01):
        thrust = controller.control(state(z=z, z_dot=z_dot), state(z=goal), time)[3]
        late.append(10.01 if time < 0.5 and start == 0.0 else thrust)
        z_dot += 0.01 * (lift * late.pop(0) - 9.81)
        z += 0.01 * z_dot
        if z <= 0.0:
            z, z_dot = 0.0, max(z_dot, 0.0)
        course.append(z)
    return np.array(course)


@pytest.mark.parametrize("lift", [0.9, 0.95 / 1.05, 0.98, 1.0, 1.02])
@pytest.mark.parametrize("goal", [0.5, 1.0, 2.5])
def test_a_soft_height_loop_takes_off_without_overshoot(lift, goal):
    course = heights(lifting(k=-0.5, limit=6.0, K=SOFT), lift, goal)
    assert course.max() < goal + 0.1
    assert np.abs(course[1000:] - goal).max() < 0.05


def test_a_controller_that_takes_over_in_flight_learns_what_the_vehicle_weighs():
    course = heights(lifting(k=-0.5, limit=6.0, K=SOFT), 0.95 / 1.05, start=1.0)
    assert np.abs(course - 1.0).max() < 0.35
    # With the integrator alone it sinks by more.
    plain = lifting(k=-0.5, limit=6.0, K=SOFT)
    plain.take_off = lambda: None
    assert heights(plain, 0.95 / 1.05, start=1.0).min() < 0.45


def test_a_soft_height_loop_without_an_integrator_does_not_overshoot_either():
    assert heights(integral(K=SOFT), 1.0).max() < 1.05
    plain = integral(K=SOFT)
    plain.take_off = lambda: None
    assert heights(plain, 1.0).max() > 1.1


def test_a_well_damped_height_loop_without_an_integrator_is_left_alone():
    K = np.zeros((4, 7))
    K[3, [2, 5]] = -200.0, -28.28
    controller = integral(K=K, limit=(1.0, 1.0, 1.0))
    controller.take_off()
    for time in (0.0, 0.1):
        u = controller.control(state(z=0.99), state(z=1.0), time)
        np.testing.assert_array_equal(u, U_REF + K @ (state(z=0.99) - state(z=1.0)))


def test_a_change_of_gains_does_not_end_a_takeoff():
    changed, unchanged = (lifting(k=-0.5, limit=6.0, K=SOFT) for _ in range(2))
    for controller in (changed, unchanged):
        controller.take_off()
        for time in np.arange(0.0, 1.0, 0.01):
            controller.control(state(), state(z=1.0), time)
    after = lifting(k=-0.5, limit=6.0, K=SOFT)
    after.take_over(changed)
    for time in np.arange(1.0, 1.5, 0.01):
        u = [each.control(state(), state(z=1.0), time) for each in (after, unchanged)]
        np.testing.assert_array_equal(*u)
