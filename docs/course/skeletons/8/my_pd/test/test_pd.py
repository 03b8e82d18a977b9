"""The PD controller: each part, then its step response and a circle."""

import math

import numpy as np
import pytest

from my_pd import pd
from my_pd.pd_node import PdFeedback
from my_pd.simulation import TIME_STEP, fly

HOVER = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0])


class Parameters:
    """Those that the controller needs, though it does not use them."""

    K = np.zeros((4, 7))
    u_ref = (0.0, 0.0, 0.0, pd.GRAVITY)


def controller():
    """Return the control law of a new controller."""
    return PdFeedback(Parameters()).control


def stepped(axis, size=0.5, yaw=0.0):
    """Return share of the step, and controls, after a step of the reference (m) along an axis."""
    goal = HOVER.copy()
    goal[axis] += size
    start = HOVER.copy()
    start[6] = goal[6] = yaw
    states, controls = fly(controller(), lambda time: goal, 5.0, start)
    return (states[:, axis] - start[axis]) / size, controls


def test_step_1_adds_three_parts(monkeypatch):
    monkeypatch.setattr(pd, "KP", 2.0)
    monkeypatch.setattr(pd, "KD", 10.0)
    error, error_dot = np.array([1.0, 0.0, 2.0]), np.array([0.0, 0.5, 0.0])
    wanted = pd.acceleration(error, error_dot, np.array([0.1, 0.2, 0.3]))
    assert wanted == pytest.approx([2.1, 5.2, 4.3])


@pytest.mark.parametrize(
    ("wanted", "yaw", "expected"),
    [
        ((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 9.81)),
        ((0.981, 0.0, 1.0), 0.0, (0.0, 0.1, 10.81)),
        ((0.0, 0.981, 0.0), 0.0, (-0.1, 0.0, 9.81)),
        ((0.981, 0.0, 0.0), math.pi / 2.0, (0.1, 0.0, 9.81)),
        ((99.0, -99.0, 0.0), 0.0, (0.25, 0.25, 9.81)),
    ],
    ids=["hover", "ahead and up", "left", "nose to the left", "too much"],
)
def test_step_2_tilts_towards_the_acceleration(wanted, yaw, expected):
    assert pd.attitude(np.array(wanted), yaw) == pytest.approx(expected, abs=1e-9)


def test_step_3_finds_the_acceleration_of_a_reference():
    feed_forward = pd.FeedForward()
    velocity = np.array([0.1, 0.0, 0.0])
    assert feed_forward.acceleration(np.zeros(3), 1.0) == pytest.approx([0.0, 0.0, 0.0])
    assert feed_forward.acceleration(velocity, 1.1) == pytest.approx([1.0, 0.0, 0.0])
    assert feed_forward.acceleration(velocity, 1.15) == pytest.approx([1.0, 0.0, 0.0])
    assert feed_forward.acceleration(velocity, 1.35) == pytest.approx([0.0, 0.0, 0.0])


def test_step_3_limits_a_jump():
    feed_forward = pd.FeedForward()
    feed_forward.acceleration(np.zeros(3), 1.0)
    assert feed_forward.acceleration(np.array([0.0, -1.0, 0.0]), 1.1)[1] == -3.0


@pytest.mark.parametrize(("axis", "yaw"), [(0, 0.0), (1, 0.0), (2, 0.0), (0, 2.0)])
def test_step_4_the_step_response_is_quick_and_calm(axis, yaw):
    share, controls = stepped(axis, yaw=yaw)
    times = TIME_STEP * np.arange(len(share))
    assert times[np.argmax(share > 0.9)] < 1.5
    assert share.max() > 0.9
    assert share.max() < 1.1
    assert np.abs(share[times > 3.0] - 1.0).max() < 0.05
    assert np.abs(controls[:, :2]).max() <= pd.MAX_TILT


def test_step_4_turns_the_short_way():
    start = HOVER.copy()
    start[6] = 3.0
    goal = HOVER.copy()
    goal[6] = -3.0
    states, controls = fly(controller(), lambda time: goal, 5.0, start)
    assert controls[0, 2] > 0.0
    assert math.remainder(states[-1, 6] + 3.0, 2.0 * math.pi) == pytest.approx(0.0, abs=0.01)


def test_a_circle_is_followed_closely_which_takes_feed_forward():
    radius, rate = 0.5, 1.2

    def circle(time):
        time = round(time / 0.05) * 0.05  # references come at 20 Hz
        c, s = math.cos(rate * time), math.sin(rate * time)
        v = radius * rate
        return np.array([radius * c, radius * s, 1.0, -v * s, v * c, 0.0, 0.0])

    states, _ = fly(controller(), circle, 10.0, circle(0.0))
    radii = np.hypot(states[:, 0], states[:, 1])[500:]
    assert np.abs(radii - radius).max() < 0.03
