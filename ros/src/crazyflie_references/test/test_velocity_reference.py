"""Where velocities lead a reference, and what it keeps to."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_references.velocity_reference import LimitParameters, Velocity, VelocityReference

LIMITS = LimitParameters(
    horizontal=0.7, vertical=0.4, yaw_dot=1.5, acceleration=1.0, min_height=0.3, max_height=2.0
)
DT = 0.02
SPEED = st.floats(-5.0, 5.0)


def reference(place=(0.0, 0.0, 1.0)):
    made = VelocityReference(LIMITS, silence=0.5)
    made.place(*place)
    return made


def fly(flown, velocity, duration, start=0.0):
    """Command a velocity at every step; return when it ends, s."""
    steps = round(duration / DT)
    for k in range(steps):
        flown.command(velocity, start + k * DT)
        flown.advance(DT, start + k * DT)
    return start + steps * DT


def test_goes_ahead_with_the_commanded_speed():
    flown = reference()
    now = fly(flown, Velocity(x=0.5), 2.0)
    before = flown.pose
    fly(flown, Velocity(x=0.5), 2.0, now)
    assert flown.pose.x - before.x == pytest.approx(1.0)
    assert flown.velocity == pytest.approx((0.5, 0.0, 0.0))
    assert (flown.pose.y, flown.pose.z, flown.pose.yaw) == (0.0, 1.0, 0.0)


def test_velocities_are_those_of_the_heading():
    flown = reference()
    now = fly(flown, Velocity(yaw_dot=math.pi / 4.0), 2.0)
    assert flown.pose.yaw == pytest.approx(math.pi / 2.0)
    fly(flown, Velocity(x=0.5), 2.0, now)
    assert flown.velocity == pytest.approx((0.0, 0.5, 0.0))
    now = fly(flown, Velocity(y=0.5), 3.0, now)
    assert flown.velocity == pytest.approx((-0.5, 0.0, 0.0))


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_circle_closes_and_has_its_radius(clockwise):
    side = -1.0 if clockwise else 1.0
    velocity = Velocity(x=0.3, yaw_dot=side * 0.3 / 0.5)
    flown = reference()
    now = fly(flown, velocity, 1.0)
    begin = flown.pose
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


@given(SPEED, SPEED, SPEED, SPEED)
def test_limits(x, y, z, yaw_dot):
    flown = reference()
    now = 0.0
    for velocity in (Velocity(x, y, z, yaw_dot), Velocity(-x, y, -z, -yaw_dot)):
        for _ in range(60):
            before, yaw, height = flown.velocity, flown.pose.yaw, flown.pose.z
            now = fly(flown, velocity, DT, now)
            vx, vy, vz = flown.velocity
            assert math.hypot(vx, vy) <= 0.7 + 1e-9
            assert abs(vz) <= 0.4
            turned = math.remainder(flown.pose.yaw - yaw, 2.0 * math.pi)
            assert abs(turned) <= 1.5 * DT + 1e-9
            # In the heading frame, which has turned.
            change = math.hypot(vx, vy) - math.hypot(*before[:2])
            assert abs(change) <= 1.0 * DT + 1e-9
            assert 0.3 - 1e-9 <= flown.pose.z <= 2.0 + 1e-9
            assert abs(flown.pose.z - height) <= 0.4 * DT + 1e-9


def test_a_limited_direction_stays():
    flown = reference()
    fly(flown, Velocity(x=3.0, y=4.0), 3.0)
    assert flown.velocity == pytest.approx((0.42, 0.56, 0.0))


@pytest.mark.parametrize(("up", "height"), [(0.4, 2.0), (-0.4, 0.3)])
def test_stops_at_the_ceiling_and_above_the_floor(up, height):
    flown = reference()
    fly(flown, Velocity(z=up), 10.0)
    assert flown.pose.z == pytest.approx(height)
    assert flown.velocity[2] == 0.0


def test_a_place_outside_is_left_inwards_only():
    flown = reference((0.0, 0.0, 3.0))
    now = fly(flown, Velocity(z=0.4), 2.0)
    assert flown.pose.z == 3.0
    fly(flown, Velocity(z=-0.4), 5.0, now)
    assert flown.pose.z < 2.0


def test_brakes_when_commands_end():
    flown = reference()
    now = fly(flown, Velocity(x=0.5, yaw_dot=1.0), 2.0)
    for k in range(20):
        flown.advance(DT, now + k * DT)
    assert math.hypot(*flown.velocity) == pytest.approx(0.5)
    for k in range(20, 55):
        flown.advance(DT, now + k * DT)
    yaw = flown.pose.yaw
    assert flown.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    place = flown.pose
    flown.advance(DT, now + 2.0)
    assert flown.pose == place
    assert flown.pose.yaw == yaw


def test_a_new_place_keeps_the_heading_and_ends_the_motion():
    flown = reference()
    fly(flown, Velocity(x=0.5, yaw_dot=1.0), 1.0)
    yaw = flown.pose.yaw
    flown.place(3.0, 2.0, 1.0)
    assert (flown.pose.x, flown.pose.y, flown.pose.z, flown.pose.yaw) == (3.0, 2.0, 1.0, yaw)
    assert flown.velocity == (0.0, 0.0, 0.0)


def test_without_a_place_it_goes_nowhere():
    flown = VelocityReference(LIMITS, 0.5)
    fly(flown, Velocity(x=0.5), 1.0)
    assert flown.pose is None
