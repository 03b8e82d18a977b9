"""When a takeoff climbs, and what a climb and the ground leave in the integrals."""

import numpy as np
import pytest

from crazyflie_lqr.linear_feedback import IntegralStateFeedback

U_REF = (0.0, 0.0, 0.0, 9.81)
GROUND = [0.0] * 7
ABOVE = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]


def controller(k_p=0.0, k_d=0.0, k=(0.0, 0.0, 0.0), limit=(9.0, 9.0, 9.0)):
    """Return a feedback with these gains of the height, and of the integrals."""
    K = np.zeros((4, 7))
    K[3, 2], K[3, 5] = -k_p, -k_d
    return IntegralStateFeedback(K, U_REF, 6, k, limit)


@pytest.mark.parametrize(
    ("k_p", "k_d", "climbs"),
    # A damping ratio of 0.7 is k_d = 1.4 sqrt(k_p).
    [(4.0, 2.8, False), (4.0, 2.75, True), (4.0, 2.85, False), (0.0, 0.0, False)],
)
def test_without_an_integral_only_a_height_loop_that_overshoots_climbs(k_p, k_d, climbs):
    feedback = controller(k_p, k_d)
    feedback.take_off()
    assert feedback.control(GROUND, ABOVE, 0.0)[3] == pytest.approx(9.81 + (0.0 if climbs else k_p))


@pytest.mark.parametrize("k", [-2.0, 1.0])
def test_the_integral_of_the_height_carries_what_the_climb_has_learned(k):
    feedback = controller(k=(0.0, 0.0, k))
    feedback.take_off()
    thrusts = [feedback.control(GROUND, ABOVE, 0.1 * count)[3] for count in range(3)]
    # 0.5 m/s^2 of the reference that the vehicle does not follow, 3/s times 0.1 s of it; and
    # in the next step of that what is not known yet.
    assert thrusts[:2] == pytest.approx([9.81, 9.81 + 0.5])
    learned = 3.0 * 0.1 * 0.5
    assert thrusts[2] == pytest.approx(9.81 + 0.5 + learned)


def test_without_an_integral_nothing_is_learned():
    feedback = controller(k_p=4.0)
    feedback.take_off()
    thrusts = [feedback.control(GROUND, ABOVE, 0.1 * count)[3] for count in range(3)]
    # The reference is 5 mm above the vehicle after 0.1 s, and 15 mm after 0.2 s.
    assert thrusts == pytest.approx([9.81, 9.81 + 0.5 + 0.02, 9.81 + 0.5 + 0.06])


def test_the_ground_ends_all_integrals():
    feedback = controller(k=(-0.01, 0.02, -0.3))
    x = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]
    for count in range(5):
        u = feedback.control(x, GROUND, 0.25 * count)
    assert u == pytest.approx([0.04, -0.01, 0.0, 9.81 - 0.9])
    feedback.reset_integrator()
    assert feedback.control(x, GROUND, 1.25) == pytest.approx(U_REF)
    feedback.enable_integrator()
    u = feedback.control(x, GROUND, 1.5)
    assert u == pytest.approx([0.01, -0.0025, 0.0, 9.81 - 0.225])


@pytest.mark.parametrize(("limit", "climbs"), [(0.0, False), (0.25, True), (2.0, True)])
def test_with_an_integral_also_a_height_loop_that_is_well_damped_climbs(limit, climbs):
    feedback = controller(4.0, 2.85, (0.0, 0.0, -1.0), (0.0, 0.0, limit))
    feedback.take_off()
    assert feedback.control(GROUND, ABOVE, 0.0)[3] == pytest.approx(9.81 + (0.0 if climbs else 4.0))
