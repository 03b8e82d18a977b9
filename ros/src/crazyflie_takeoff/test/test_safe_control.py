"""What the filter flies by itself: thrust of hover, braking."""

import pytest
from filter_flight import G, level

from crazyflie_takeoff.motion import Motion
from crazyflie_takeoff.safe_control import (
    MAX_BRAKING,
    HoverThrust,
    SafeControl,
    Setpoint,
)


def test_learns_the_thrust_of_hover_also_from_a_climb():
    hover = HoverThrust()
    for k in range(1000):
        hover.update(0.01, level(10.8 + (0.5 if k >= 900 else 0.0)), max(0.0, (k - 900) * 0.005))
    assert hover.value == pytest.approx(10.8, abs=0.03)
    for _ in range(1000):
        hover.update(0.01, level(16.0), None)
    assert hover.value == 1.25 * G


@pytest.mark.parametrize(
    ("roll", "pitch", "vertical"),
    [(0.2, 0.0, 0.9800666), (0.0, 0.2, 0.9800666), (0.2, -0.1, 0.9751703)],
)
def test_learns_the_vertical_part_of_a_tilted_thrust(roll, pitch, vertical):
    tilted = HoverThrust()
    for _ in range(2000):
        tilted.update(0.01, Setpoint(roll, pitch, 0.0, G / vertical), 0.0)
    assert tilted.value == pytest.approx(G, rel=1e-6)


def test_a_state_that_is_the_last_one_is_not_taken_again():
    # 0.2 s at full thrust after it, the vehicle rises by 1.2 m/s more: that is braked at once.
    motion = Motion((0.0, 0.0, 0.5), (0.0, 0.0, 0.4))
    safe = SafeControl(G, motion, 0.2, Setpoint(0.0, 0.0, 0.0, 16.0))
    thrusts = [safe.advance(0.01, motion, False).thrust for _ in range(3)]
    assert max(thrusts) == pytest.approx(G - MAX_BRAKING)
    # A new one counts.
    slow = motion._replace(velocity=(0.0, 0.0, 0.0))
    assert safe.advance(0.01, slow, False).thrust > G - 1.0


def test_without_a_state_a_hover_thrust_that_is_too_high_hardly_lifts():
    z, z_dot = 1.5, 0.05
    safe = SafeControl(1.015 * G, Motion((0.0, 0.0, z), (0.0, 0.0, z_dot)))
    highest = z
    for k in range(800):
        z_dot += 0.01 * (safe.advance(0.01, None, k >= 160).thrust - G)
        z += 0.01 * z_dot
        highest = max(highest, z)
    assert highest < 1.65
    assert z < 0.0
