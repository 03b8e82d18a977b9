"""Where a follower flies, and that it arrives."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_vision.follow import GainParameters, SpeedParameters, TargetFollower
from crazyflie_vision.trackers import Target

F = 208.0
CENTRE = (159.5, 119.5)
FOLLOWER = TargetFollower(
    distance=1.0,
    radius=0.12,
    gains=GainParameters(forward=1.0, up=1.0, turn=1.5),
    limits=SpeedParameters(forward=0.5, up=0.3, turn=1.0),
)
AT_REST = Target(*CENTRE, F * 0.12)


def velocity(target):
    return FOLLOWER.velocity(target, F, CENTRE)


def test_at_its_place_it_rests():
    v = velocity(AT_REST)
    assert (v.x, v.y, v.z, v.yaw_dot) == pytest.approx((0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("target", "field", "expected"),
    [
        (Target(*CENTRE, F * 0.12 / 1.3), "x", 0.3),
        (Target(*CENTRE, F * 0.12 / 0.8), "x", -0.2),
        (Target(CENTRE[0] + F * 0.1, CENTRE[1], F * 0.12), "yaw_dot", -1.5 * math.atan(0.1)),
        (Target(CENTRE[0] - F * 0.1, CENTRE[1], F * 0.12), "yaw_dot", 1.5 * math.atan(0.1)),
        (Target(CENTRE[0], CENTRE[1] + F * 0.1, F * 0.12), "z", -0.1),
        # The same angle, twice as far away.
        (Target(CENTRE[0], CENTRE[1] - F * 0.1, F * 0.06), "z", 0.2),
    ],
)
def test_each_error_has_its_velocity(target, field, expected):
    assert getattr(velocity(target), field) == pytest.approx(expected)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_limits(x, y, radius):
    v = velocity(Target(x, y, radius))
    assert abs(v.x) <= 0.5
    assert abs(v.z) <= 0.3
    assert abs(v.yaw_dot) <= 1.0
    assert v.y == 0.0


@given(st.floats(0.4, 4.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_it_arrives(depth, bearing, height):
    # A vehicle that has every velocity at once; what it follows rests.
    yaw, z, x, y = 0.0, 0.0, 0.0, 0.0
    place = (depth * math.cos(bearing), depth * math.sin(bearing), height)
    for _ in range(400):
        east, north = place[0] - x, place[1] - y
        ahead = math.cos(yaw) * east + math.sin(yaw) * north
        left = math.cos(yaw) * north - math.sin(yaw) * east
        target = Target(
            CENTRE[0] - F * left / ahead,
            CENTRE[1] - F * (place[2] - z) / ahead,
            F * 0.12 / ahead,
        )
        v = velocity(target)
        x, y = x + 0.05 * v.x * math.cos(yaw), y + 0.05 * v.x * math.sin(yaw)
        z, yaw = z + 0.05 * v.z, yaw + 0.05 * v.yaw_dot
    assert velocity(target).x == pytest.approx(0.0, abs=1e-3)
    assert math.dist((x, y, z), place) == pytest.approx(1.0, abs=1e-2)
    assert z == pytest.approx(height, abs=1e-2)
