"""Whatever live parameter changes at whatever moment of a flight, the control stays sound."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from lift_controller import answer, lifting, publish_flight_state, refer

from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_model.dynamics import Coupled7D
from crazyflie_model.limits import MAX_THRUST, MAX_TILT, MIN_THRUST
from crazyflie_references.governor import ReferenceGovernor
from crazyflie_utils import ServiceError

SOFT = np.zeros((4, 7))
SOFT[0, [1, 4]] = 0.25, 1.0
SOFT[1, [0, 3]] = -0.25, -1.0
SOFT[2, 6], SOFT[3, [2, 5]] = -3.5, (-1.5, -1.0)
U_REF = (0.0, 0.0, 0.0, 9.81)

# Every finite number is legal; the small and the large ones are those that break a formula.
FINITE = st.floats(allow_nan=False, allow_infinity=False)
GAIN = st.sampled_from([0.0, 5e-324, -5e-324, 1.7e308, -1.7e308, -0.5, -0.05, 0.05]) | FINITE
LIMIT = st.sampled_from([0.0, 5e-324, 1.7e308, 1.0, 6.0]) | st.floats(0.0, 1e6)
CHANGES = st.lists(
    st.tuples(
        st.integers(0, 80),
        st.tuples(GAIN, GAIN, GAIN),
        st.tuples(LIMIT, LIMIT, LIMIT),
        st.floats(0.01, 100.0),
    ),
    max_size=6,
)


def sound(u):
    assert all(map(math.isfinite, u))
    assert max(map(abs, u[:2])) <= MAX_TILT
    assert MIN_THRUST <= u[3] <= MAX_THRUST


@pytest.mark.filterwarnings("error")
@given(CHANGES)
def test_any_integrator_and_gains_at_any_moment_of_a_takeoff(changes):
    model = Coupled7D()
    x = model.initial_state((0.0, 0.0, 0.0))
    controller = IntegralStateFeedback(SOFT, U_REF, 6, (-0.05, 0.05, -0.5), (1.0, 1.0, 6.0))
    controller.take_off()
    goal = (0.3, -0.2, 1.0, 0.0, 0.0, 0.0, 0.0)
    for tick in range(80):
        for moment, k, limit, factor in changes:
            if moment == tick:
                changed = IntegralStateFeedback(SOFT * factor, U_REF, 6, k, limit)
                changed.take_over(controller)
                controller = changed
        u = controller.control(x, goal, 0.05 * tick)
        sound(u)
        for _ in range(50):
            x = model.step(0, x, u)


def test_a_climb_goes_on_without_the_integrator_of_the_height():
    process = lifting()
    publish_flight_state(process, "taking_off")
    refer(process, z=1.0)
    for k in range(10):
        process.advance(0.05)
        sound(answer(process, z=0.02 * k, z_dot=0.4)[0])
    process.reconfigure("/lqr_controller", **{"integrator/k/z": 0.0})
    for k in range(10, 60):
        process.advance(0.05)
        (control,) = answer(process, z=0.02 * k, z_dot=0.4)
        sound(control)


def test_a_smaller_limit_holds_for_what_the_climb_has_learned():
    before = IntegralStateFeedback(SOFT, U_REF, 6, (0.0, 0.0, -0.5), (0.0, 0.0, 6.0))
    before.take_off()
    standing, goal = [0.0] * 7, [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    for tick in range(100):
        before.control(standing, goal, 0.01 * tick)
    after = IntegralStateFeedback(SOFT, U_REF, 6, (0.0, 0.0, -0.5), (0.0, 0.0, 0.1))
    after.take_over(before)
    for tick in range(100, 200):
        u = after.control(standing, goal, 0.01 * tick)
    # The height error is 0.15 m at most, its rate 0.4 m/s: what is more is the integral.
    assert u[3] <= 9.81 + 0.15 * 1.5 + 0.4 + 0.5 + 0.5 * 0.1


def test_gains_that_overflow_are_refused(tmp_path):
    process = lifting()
    refer(process, z=1.0)
    gains = tmp_path / "K.txt"
    gains.write_text("0 1e308 0 0 1e308 0 0\n" * 4)
    with pytest.raises(ServiceError, match=r"K_file has 1e\+308 among its numbers; expected"):
        process.reconfigure("/lqr_controller", K_file=str(gains))
    sound(answer(process, y=9.0, y_dot=-9.0)[0])


@example(1e-310, (1.0, 1.0, 1e-309), (1.0, 1.0, 0.0))
@given(
    st.floats(0.0, exclude_min=True, allow_infinity=False),
    st.tuples(FINITE, FINITE, FINITE),
    st.tuples(*[st.floats(-10.0, 10.0)] * 3),
)
def test_any_reach_of_references_leaves_them_finite(max_jump, place, vehicle):
    reference = ReferenceGovernor(6, max_jump)
    reference.update([*place, 0.0, 0.0, 0.0, 0.0])
    followed = reference.value(0.0, [*vehicle, 0.0, 0.0, 0.0, 0.0])
    assert all(map(math.isfinite, followed))
    assert math.dist(followed[:3], vehicle) <= max_jump * (1.0 + 1e-9) + 1e-12 or math.dist(
        followed[:3], vehicle
    ) == math.dist(place, vehicle)


def test_limits_of_the_control_may_be_narrower_in_flight_and_not_wider():
    limits = {"control/max_roll": 0.1, "control/max_thrust": 12.0, "control/min_thrust": 9.0}
    process = lifting(**limits)
    refer(process)
    assert answer(process, x=1.5, y=1.5, z=1.5)[0][[0, 1, 3]] == pytest.approx([0.1, -0.2618, 9.0])
    process.reconfigure("/lqr_controller", **{"control/max_pitch": 0.05})
    assert answer(process, x=1.5, y=-1.5, z=-1.5)[0][[0, 1, 3]] == pytest.approx(
        [-0.1, -0.05, 12.0]
    )
    for name, value in (("max_roll", 0.3), ("max_thrust", 17.0), ("min_thrust", 9.9)):
        with pytest.raises(ServiceError, match=f"control/{name}|thrust of u_ref_file"):
            process.reconfigure("/lqr_controller", **{f"control/{name}": value})


def test_an_integral_does_not_grow_into_a_narrower_limit():
    process = lifting(**{"control/max_thrust": 10.0})
    publish_flight_state(process, "flying")
    refer(process, z=1.0)
    for k in range(80):
        process.advance(0.1)
        assert answer(process, z=1.0 if k < 20 else 0.8)[0][3] <= 10.0
    process.advance(0.1)
    assert answer(process, z=1.0)[0][3] == pytest.approx(9.81, abs=0.01)
