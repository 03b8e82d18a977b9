"""The velocity of the circle."""

import math

import pytest

from crazyflie_references.velocity_reference import ReferenceLimits, VelocityReference
from crazyflie_teleop.circle import circle_velocity

LIMITS = ReferenceLimits(0.7, 0.4, 1.5, acceleration=1.0, min_height=0.3, max_height=2.0)
DT = 0.02


def fly(flown, velocity, duration, start=0.0):
    """Command a velocity at every step; return when it ends, s."""
    steps = round(duration / DT)
    for k in range(steps):
        flown.command(velocity, start + k * DT)
        flown.advance(DT, start + k * DT)
    return start + steps * DT


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_circle_closes_and_has_its_radius(clockwise):
    flown = VelocityReference(LIMITS, silence=0.5)
    flown.place(0.0, 0.0, 1.0)
    velocity = circle_velocity(radius=0.5, speed=0.3, clockwise=clockwise)
    now = fly(flown, velocity, 1.0)
    begin = flown.pose
    side = -1.0 if clockwise else 1.0
    middle = (
        begin.x - side * 0.5 * math.sin(begin.yaw),
        begin.y + side * 0.5 * math.cos(begin.yaw),
    )
    period = 2.0 * math.pi * 0.5 / 0.3
    quarter = fly(flown, velocity, period / 4.0, now)
    turned = math.remainder(flown.pose.yaw - begin.yaw, 2.0 * math.pi)
    assert turned == pytest.approx(side * math.pi / 2.0, abs=0.02)
    for _ in range(3):
        assert math.dist((flown.pose.x, flown.pose.y), middle) == pytest.approx(0.5, abs=1e-3)
        quarter = fly(flown, velocity, period / 4.0, quarter)
    assert (flown.pose.x, flown.pose.y) == pytest.approx((begin.x, begin.y), abs=0.03)
