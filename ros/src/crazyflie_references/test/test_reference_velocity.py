"""How far the velocity of references leads a vehicle."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_references.governor import ReferenceGovernor
from crazyflie_references.velocity_check import VELOCITY_LIMIT

HERE = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]


def guarded(reports=None, max_speed=2.0):
    report = (lambda *_: None) if reports is None else lambda _, text: reports.append(text)
    return ReferenceGovernor(6, 3.0, report, max_speed)


def streamed(reference, period, duration, point, velocity, begin=0.0):
    """Send references; return the velocities that are followed, shape (n, 3)."""
    followed = []
    for k in range(round(duration / period)):
        time = begin + k * period
        reference.update([*point(time), *velocity(time), 0.0], time=time)
        x_ref = reference.value(time, [*point(time), 0.0, 0.0, 0.0, 0.0])
        followed.append(x_ref[3:6])
    return np.array(followed)


def stays(time):
    return 0.0, 0.0, 1.0


def test_a_large_velocity_keeps_its_direction():
    reports = []
    reference = guarded(reports)
    reference.update([0.0, 0.0, 1.0, 6.0, 0.0, -8.0, 0.3])
    assert reference.value(0.0, HERE) == pytest.approx([0.0, 0.0, 1.0, 1.2, 0.0, -1.6, 0.3])
    assert reports == [
        "the reference has a velocity of 10.0 m/s; expected <= 2 m/s, the velocity is limited"
    ]


@given(st.tuples(*[st.floats(-1.15, 1.15)] * 3), st.floats(0.0, 0.99 * VELOCITY_LIMIT))
def test_what_is_within_the_limits_is_followed_as_it_is(velocity, time):
    reference = guarded()
    x_ref = [0.1, 0.2, 0.9, *velocity, 0.3]
    reference.update(HERE)
    reference.update(x_ref, time=5.0)
    assert reference.value(5.0 + time, HERE) == x_ref


@given(st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_any_velocity_is_followed_within_the_limit(velocity):
    reference = guarded()
    for k in range(3):
        reference.update([0.0, 0.0, 1.0, *velocity, 0.0], time=0.01 * k)
        assert math.hypot(*reference.value(0.01 * k, HERE)[3:6]) <= 2.0 + 1e-9


def test_one_that_is_not_renewed_becomes_a_place_to_rest_at():
    reports = []
    reference = guarded(reports)
    x_ref = [0.1, 0.0, 1.0, 0.5, 0.0, 0.2, 0.7]
    reference.update(x_ref, time=10.0)
    assert reference.value(10.49, HERE) == x_ref
    for time in (10.5, 20.0):
        assert reference.value(time, HERE) == [0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 0.7]
    assert reports == [
        "the reference has a velocity and none has followed for 0.5 s; stopping at its position"
    ]
    reference.update(x_ref, time=30.0)
    assert reference.value(30.1, HERE) == x_ref
    # Time was reset.
    assert reference.value(1.0, HERE)[3:6] == [0.0, 0.0, 0.0]


def test_one_that_a_descent_has_ended_needs_no_report():
    reports = []
    reference = guarded(reports)
    reference.update([0.1, 0.0, 1.0, 0.5, 0.0, 0.2, 0.7], time=10.0)
    for k in range(100):
        reference.descend([0.1, 0.0, 1.0 - 0.01 * k, 0.0, 0.0, -0.2, 0.7], 10.02 + 0.05 * k)
    # The descent is over.
    assert reference.value(20.0, HERE) == [0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 0.7]
    assert reports == []


def test_one_at_rest_is_for_ever_and_needs_no_report():
    reports = []
    reference = guarded(reports)
    reference.update(HERE)
    assert reference.value(1e6, HERE) is HERE
    assert reports == []


@pytest.mark.parametrize("period", [0.01, 0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("speed", [0.3, 2.0])
def test_a_trajectory_is_followed_with_its_velocity(period, speed):
    # A circle of 1 m, as trajectories are streamed.
    def point(time):
        return math.cos(speed * time), math.sin(speed * time), 1.0

    def velocity(time):
        return -speed * math.sin(speed * time), speed * math.cos(speed * time), 0.0

    followed = streamed(guarded(), period, 20.0, point, velocity)
    np.testing.assert_allclose(np.linalg.norm(followed, axis=1), speed)


def test_a_trajectory_that_arrives_irregularly_is_followed_with_its_velocity():
    random = np.random.default_rng(3)
    reference, time, sent = guarded(), 0.0, 0.0
    for _ in range(2000):
        sent += random.uniform(0.0, 0.04)
        # Late by up to 50 ms, but in order; one of ten is lost.
        time = max(time, sent + random.uniform(0.0, 0.05))
        if random.uniform() < 0.1:
            continue
        x_ref = [math.sin(sent), 0.0, 1.0, math.cos(sent), 0.0, 0.0, 0.0]
        reference.update(x_ref, time=time)
        assert reference.value(time, HERE) is x_ref


@pytest.mark.parametrize("period", [0.01, 0.1])
@pytest.mark.parametrize("velocity", [(2.0, 0.0, 0.0), (100.0, -100.0, 100.0), (0.0, 0.0, -0.5)])
def test_the_velocity_of_points_that_stay_does_not_count_for_long(period, velocity):
    reports = []
    followed = streamed(guarded(reports), period, 5.0, stays, lambda time: velocity)
    led = np.linalg.norm(period * followed.sum(axis=0))
    # Part of the 0.5 m is forgotten meanwhile.
    assert led <= 0.75 + 2.0 * period
    assert not followed[-10:].any()
    assert "is ignored, since they do not move with it" in reports[-1]


@pytest.mark.parametrize("size", [0.2, 1.0])
def test_nor_does_that_of_points_that_jump_to_and_fro(size):
    def point(time):
        return size * (round(10.0 * time) % 2), 0.0, 1.0

    followed = streamed(guarded(), 0.1, 6.0, point, lambda time: (2.0, 0.0, 0.0))
    assert not followed[-30:].any()


def test_velocities_count_again_when_the_points_move_with_them():
    reference = guarded()
    streamed(reference, 0.02, 5.0, stays, lambda time: (1.0, 0.0, 0.0))
    followed = streamed(
        reference, 0.02, 4.0, lambda time: (time - 5.0, 0.0, 1.0), lambda time: (1.0, 0.0, 0.0), 5.0
    )
    assert not followed[0].any()
    np.testing.assert_array_equal(followed[-50:], [[1.0, 0.0, 0.0]] * 50)


def test_points_that_move_without_a_velocity_leave_the_next_velocity_alone():
    reference = guarded()
    streamed(reference, 0.02, 3.0, lambda time: (0.5 * time, 0.0, 1.0), lambda time: (0.0,) * 3)
    reference.update([1.5, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0], time=3.0)
    assert reference.value(3.0, [1.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])[3] == 1.0


def test_the_largest_velocity_is_followed_as_it_is():
    reports = []
    streamed(guarded(reports), 0.1, 0.2, lambda t: [2.0 * t, 0.0, 1.0], lambda t: [2.0, 0.0, 0.0])
    assert not reports
