"""Flight by the filter's own controls: thrust of hover, braking."""

import math

import pytest
from filter_flight import G

from crazyflie_takeoff.fallback import (
    AVERAGING,
    LAST_DIFFERENCE,
    MAX_BRAKING,
    SafeControl,
    SafeSetpoint,
    braking_time,
    descent_time,
)
from crazyflie_takeoff.hover_thrust import LAG, MOST_HOVER, HoverThrust
from crazyflie_takeoff.motion import Motion


@pytest.mark.parametrize(
    ("weight", "is_known", "error"),
    [(0.65, True, 0.004), (1.0, True, 0.004), (1.2, True, 0.004), (1.0, False, 0.01)],
)
@pytest.mark.parametrize("duration", [0.2, 0.8])
def test_learns_the_thrust_of_hover_also_within_a_climb(weight, is_known, error, duration):
    """Thrust that the motors follow late was taken for weight: 2 % too much without a state."""
    hover = HoverThrust(AVERAGING, weight * G if is_known else None)
    acceleration = climb = z_dot = 0.0
    for k in range(300):
        target = 1.0 if 0.01 * k < duration else 0.0
        lift = weight * (G + 4.0 * (target - z_dot))
        acceleration += 0.01 / 0.07 * (lift / weight - G - acceleration)
        climb += 0.01 * acceleration
        z_dot += 0.01 / 0.04 * (climb - z_dot)  # The estimator's.
        hover.update(0.01, lift, z_dot)
        assert hover.value == pytest.approx(weight * G, rel=error)


def test_the_thrust_of_hover_is_within_its_range():
    hover = HoverThrust(AVERAGING)
    for _ in range(2000):
        hover.update(0.01, 16.0, None)
    assert hover.value == MOST_HOVER


@pytest.mark.parametrize("wrong", [1e6, -1e6, 1e308, -1e308])
def test_one_wrong_speed_is_no_weight(wrong):
    """Of another estimator: the vehicle was flown as a heavy one, or with a thrust of nan."""
    hover = HoverThrust(AVERAGING, G)
    for k in range(60):
        hover.update(0.01, G, wrong if k == 40 else 0.0)
    assert hover.value == pytest.approx(G, rel=0.01)


@pytest.mark.parametrize(
    ("roll", "pitch", "vertical"),
    [(0.2, 0.0, 0.9800666), (0.0, 0.2, 0.9800666), (0.2, -0.1, 0.9751703)],
)
def test_learns_the_vertical_part_of_a_tilted_thrust(roll, pitch, vertical):
    tilted = HoverThrust(AVERAGING)
    for _ in range(2000):
        tilted.update(0.01, SafeSetpoint(roll, pitch, 0.0, G / vertical).lift, 0.0)
    assert tilted.value == pytest.approx(G, rel=1e-6)


def test_a_state_that_is_the_last_one_is_not_taken_again():
    # 0.2 s at full thrust after it, the vehicle rises by 1.2 m/s more: that is braked at once.
    motion = Motion((0.0, 0.0, 0.5), (0.0, 0.0, 0.4))
    safe = SafeControl(G, motion, 0.2, SafeSetpoint(0.0, 0.0, 0.0, 16.0))
    thrusts = [safe.advance(0.01, motion, False).thrust for _ in range(3)]
    assert max(thrusts) == pytest.approx(G - MAX_BRAKING)
    # A new one is used.
    slow = motion._replace(velocity=(0.0, 0.0, 0.0))
    assert safe.advance(0.01, slow, False).thrust > G - 1.0


@pytest.mark.parametrize("error", [0.015, LAST_DIFFERENCE])
def test_without_a_state_a_hover_thrust_that_is_too_high_hardly_lifts(error):
    """Up to that difference, the last motion before the loss does not correct it."""
    z, z_dot = 1.5, 0.05
    motion = Motion((0.0, 0.0, z), (0.0, 0.0, z_dot))
    safe = SafeControl((1.0 + error) * G, motion)
    highest, time = z, 0.0
    while z > 0.0:
        z_dot += 0.01 * (safe.advance(0.01, None, time >= 1.6).thrust - G)
        z += 0.01 * z_dot
        time += 0.01
        highest = max(highest, z)
        # Then the motors stop.
        assert time < 1.6 + 5.0 + descent_time(motion, 0.0)
    assert highest < 2.0


# Figures by hand: 0.25 g per m and 0.3 g per m/s, tilt at most 0.15 rad.


@pytest.mark.parametrize(
    ("yaw", "roll", "pitch"),
    [(0.0, -math.atan(0.035), -math.atan(0.07)), (math.pi / 2, -math.atan(0.07), math.atan(0.035))],
)
def test_a_vehicle_is_stopped_at_the_place_that_it_reaches_in_half_a_second(yaw, roll, pitch):
    motion = Motion((1.0, 2.0, 1.0), (0.4, -0.2, 0.0), yaw)
    # The place is (0.2, -0.1) m ahead: 0.25 * 0.2 - 0.3 * 0.4 and -0.25 * 0.1 + 0.3 * 0.2.
    control = SafeControl(G, motion).advance(0.0, motion, False)
    assert control == pytest.approx((roll, pitch, 0.0, G))


@pytest.mark.parametrize(
    ("away", "speed", "pitch"),
    [(0.2, 0.0, -math.atan(0.05)), (2.0, 0.0, -math.atan(0.125)), (-2.0, -0.5, 0.15)],
)
def test_the_place_counts_up_to_half_a_metre_and_tilt_is_limited(away, speed, pitch):
    safe = SafeControl(G, None)
    safe.advance(0.0, Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), False)
    control = safe.advance(0.0, Motion((away, 0.0, 1.0), (speed, 0.0, 0.0)), False)
    assert control.pitch == pytest.approx(pitch)
    sideways = safe.advance(0.0, Motion((0.0, away, 1.0), (0.0, speed, 0.0)), False)
    assert sideways.roll == pytest.approx(-pitch)


@pytest.mark.parametrize(
    ("z", "z_dot", "thrust"),
    [
        # The target is 1 m/s per m, 0.3 m/s at most; the speed follows it in 0.3 s.
        (0.9, 0.0, 0.1 / 0.3),
        (1.1, 0.0, -0.1 / 0.3),
        (0.2, 0.0, 1.0),
        (0.9, 0.4, -1.0),
        (0.9, -2.0, 0.2 * 9.81),
        (0.9, 2.0, -0.4 * 9.81),
    ],
)
def test_it_returns_to_the_height_of_the_beginning(z, z_dot, thrust):
    safe = SafeControl(G, None)
    safe.advance(0.0, Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.0)), False)
    control = safe.advance(0.0, Motion((0.0, 0.0, z), (0.0, 0.0, z_dot)), False)
    assert control.thrust - G == pytest.approx(thrust)


@pytest.mark.parametrize(
    ("z_dot", "thrust"),
    [
        # 0.3924 m/s are ended in 0.1 s with 0.4 g, within 19.62 mm; 0.1962 m/s with 0.2 g.
        (0.3924, (0.01962 - 0.3924) / 0.3),
        (-0.1962, (-0.00981 + 0.1962) / 0.3),
    ],
)
def test_the_height_to_keep_is_where_the_vertical_speed_ends(z_dot, thrust):
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, z_dot))
    control = SafeControl(G, motion).advance(0.0, motion, False)
    assert control.thrust - G == pytest.approx(thrust)


def test_a_descent_gets_faster_up_to_its_speed():
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, -0.2))
    safe = SafeControl(G, motion)
    thrusts = [safe.advance(0.05, motion._replace(yaw=0.0), True).thrust - G for _ in range(40)]
    # 0.3 m/s^2 for 0.05 s; 0.4 m/s in the end.
    assert thrusts[:2] == pytest.approx([(0.2 - 0.015) / 0.3, (0.2 - 0.03) / 0.3])
    assert thrusts[-1] == pytest.approx(-0.2 / 0.3)
    # For a step that is too long, 0.05 s is used.
    thrust = SafeControl(G, motion).advance(9.0, motion._replace(yaw=0.0), True).thrust
    assert thrust - G == pytest.approx((0.2 - 0.015) / 0.3)


def test_the_thrust_of_a_vehicle_that_does_not_sink_goes_down_further():
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    safe = SafeControl(G, motion)
    thrusts = [safe.advance(0.05, motion._replace(yaw=0.0), True).thrust - G for _ in range(40)]
    # The thrust decreases from a target of 0.2 m/s by 4 m/s^2 per second to 0.4 g.
    assert thrusts[12] == pytest.approx(-0.195 / 0.3)
    assert thrusts[13] == pytest.approx(-0.21 / 0.3 - 0.2)
    assert thrusts[-1] == pytest.approx(-0.4 * G)
    sinking = motion._replace(velocity=(0.0, 0.0, -0.4))
    thrusts = [safe.advance(0.05, sinking._replace(yaw=0.0), True).thrust - G for _ in range(40)]
    assert thrusts[-1] == 0.0


def test_without_a_state_the_velocity_is_reckoned_from_the_control():
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    safe = SafeControl(G, motion, 0.1, SafeSetpoint(0.1, 0.2, 0.0, G + 1.0))
    assert safe.climb == pytest.approx(0.1)
    control = safe.advance(0.0, None, False)
    # g tan(0.2) for 0.1 s forward, g tan(0.1) to the right; 0.3 g per m/s against it.
    assert math.tan(control.pitch) == pytest.approx(-0.03 * G * math.tan(0.2))
    assert math.tan(control.roll) == pytest.approx(-0.03 * G * math.tan(0.1))
    assert control.thrust - G == pytest.approx(-0.1 / 0.3)
    turned = SafeControl(G, motion._replace(yaw=math.pi), 0.1, SafeSetpoint(0.1, 0.2, 0.0, G))
    assert turned.advance(0.0, None, False)[:2] == pytest.approx(control[:2])


def test_a_heavy_vehicle_gets_no_more_thrust_than_the_most():
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, -2.0))
    assert SafeControl(1.2 * G, motion).advance(0.0, motion, False).thrust == 1.25 * G


def test_how_long_braking_and_a_descent_take():
    assert [braking_time(each * G) for each in (0.4, 0.0, -0.2)] == pytest.approx([1.0, 0.0, 1.0])
    still, sinking, climbing = (
        Motion((0.0, 0.0, 1.5), (0.0, 0.0, z_dot)) for z_dot in (0.0, -1.0, 0.4 * G)
    )
    assert descent_time(still, 0.5) == pytest.approx(2.5)
    assert descent_time(sinking, 0.5) == pytest.approx(2.5)
    # 1 s to end the climb, in which it rises by 0.2 g.
    assert descent_time(climbing, 0.5) == pytest.approx(1.0 + (1.0 + 0.2 * G) / 0.4)
    assert descent_time(still, 9.0) == 0.0


def test_the_mean_of_hover_by_its_time_constant():
    hover = HoverThrust(2.0, G)
    hover.update(2.0, G, 1.0)
    hover.update(2.0, G, 2.0)
    # Half of 1 m/s in 2 s.
    assert hover.value == pytest.approx(G * G / (G + 0.25))
    hover.skip(5.0)
    hover.update(2.0, hover.value, 5.0)
    assert hover.value == pytest.approx(G * (G * G / (G + 0.25) + G) / 2.0 / (G + 0.125))
    hover.update(1e-9, G, None)
    assert hover.value == pytest.approx((G * G / (G + 0.25) + G) / 2.0)


def test_thrust_counts_when_the_motors_have_followed():
    hover = HoverThrust(2.0, G)
    hover.update(LAG, G + 1.0, None)
    share = LAG / (2.0 + LAG)
    assert hover.value == pytest.approx(G + 0.5 * share)
    hover.update(LAG, G + 1.0, None)
    assert hover.value == pytest.approx(G + 0.5 * share + share * (0.75 - 0.5 * share))


def test_a_vehicle_of_another_weight_is_known_soon():
    hover = HoverThrust(2.0)
    for _ in range(100):
        hover.update(0.01, 1.2 * G, 0.0)
    assert hover.value == pytest.approx(1.2 * G, rel=0.06)
    for _ in range(300):
        hover.update(0.01, 1.2 * G, 0.0)
    assert hover.value == pytest.approx(1.2 * G, rel=0.01)


def test_a_mixture_of_controls():
    mixed = SafeSetpoint(0.0, 1.0, 2.0, 3.0).mixed(SafeSetpoint(4.0, 3.0, 2.0, -1.0), 0.25)
    assert mixed == (1.0, 1.5, 2.0, 2.0)


def test_without_any_state_it_is_level_and_sinks_slowly():
    safe = SafeControl(G, None)
    assert safe.climb == 0.0
    assert safe.advance(0.0, None, False) == (0.0, 0.0, 0.0, G)
    assert safe.advance(0.05, None, False).thrust - G == pytest.approx(-0.015 / 0.3)


def test_a_state_from_the_future_is_not_reckoned_back():
    motion = Motion((0.0, 0.0, 1.0), (0.0, 0.0, 0.25))
    assert SafeControl(G, motion, -0.1, SafeSetpoint(0.0, 0.0, 0.0, 16.0)).climb == 0.25
