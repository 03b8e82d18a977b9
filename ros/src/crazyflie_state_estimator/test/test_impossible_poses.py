"""Poses that cannot be, and a vehicle that tips over."""

import math
from random import Random

import numpy as np
import pytest
from estimator_helpers import fly, launch, transform
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped

G = 9.81

# Poses that cannot be.


def hover(process, duration, x=0.0, attitude=(0.0, 0.0, 0.0)):
    """Broadcast a pose that does not move; return the new states."""
    before = len(process.published("/state"))
    fly(process, lambda elapsed: ((x, 0.0, 1.0), attitude), duration)
    return [message.state for message in process.published("/state")[before:]]


def rejected(process):
    process.advance(1.0)
    (status,) = process.published("/diagnostics")[-1].status
    return {pair.key.removeprefix("rejected: "): int(pair.value) for pair in status.values}


def test_one_pose_elsewhere_is_passed_over():
    process = launch()
    hover(process, 0.5)
    assert hover(process, 0.01, x=0.5) == []
    (state,) = hover(process, 0.01)
    assert (state.x, state.x_dot) == (0.0, 0.0)
    assert rejected(process)["is too far away"] == 1


@pytest.mark.parametrize("speed", [4.9, 7.5])
def test_a_vehicle_may_fly_fast_but_not_faster_than_it_can(speed):
    process = launch()
    fly(process, lambda elapsed: ((speed * elapsed, 0.0, 1.0), (0.0, 0.0, 0.0)), 5.0)
    assert (rejected(process)["rejected"] > 0) == (speed > 5.0)


def test_a_vehicle_that_was_carried_is_found_again_after_three_tenths_of_a_second():
    process = launch()
    hover(process, 0.5)
    assert hover(process, 0.3, x=2.0) == []
    states = hover(process, 0.2, x=2.0)
    assert len(states) >= 18
    assert {(state.x, state.x_dot) for state in states} == {(2.0, 0.0)}


# A pose that has jumped in flight.


def fly_with(process, control, position, duration):
    """Broadcast ``position(elapsed)`` while a control is flown; return the new states."""
    before = len(process.published("/state"))
    for k in range(round(duration * 100)):
        process.publish("/control/final", ControlStamped(control=Control(*control)))
        process.publish("/tf", TFMessage([transform(process, position(0.01 * k))]))
        process.advance(0.01)
    return [message.state for message in process.published("/state")[before:]]


HOVER, OFF = (0.0, 0.0, 0.0, G), (0.0, 0.0, 0.0, 0.0)


@pytest.fixture
def flying():
    """Return the process of an estimator that has seen a takeoff and a hover at 1 m."""
    process = launch(**{"topics/control": "/control/final"})
    fly_with(process, OFF, lambda _: (0.0, 0.0, 0.0), 0.5)
    # Up by 1 m in 2 s, half of which are a deceleration.
    fly_with(process, (0.0, 0.0, 0.0, G + 1.0), lambda t: (0.0, 0.0, 0.5 * t * t), 1.0)
    fly_with(process, (0.0, 0.0, 0.0, G - 1.0), lambda t: (0.0, 0.0, 0.5 + t - 0.5 * t * t), 1.0)
    states = fly_with(process, HOVER, lambda _: (0.0, 0.0, 1.0), 2.0)
    assert states[-1].z == pytest.approx(1.0, abs=1e-3)
    return process


@pytest.mark.parametrize(
    "jump", [(0.5, 0.0, 1.0), (1.0, -1.0, 1.0), (0.0, 0.0, 3.0), (9.0, 0.0, 0.0)]
)
@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_place_to_which_the_pose_has_jumped_in_flight_is_not_believed(flying, jump, noise):
    random = Random(1)

    def place(_):
        return tuple(x + random.gauss(0.0, noise) for x in jump)

    assert fly_with(flying, HOVER, place, 2.0) == []
    # Nor while the filter lets the vehicle sink.
    assert fly_with(flying, (0.0, 0.0, 0.0, G - 0.5), place, 2.0) == []
    # It was carried: the motors are off.
    states = fly_with(flying, OFF, place, 0.9)
    assert len(states) >= 8
    assert states[-1].x == pytest.approx(jump[0], abs=0.02)


def test_poses_that_have_jumped_and_move_as_the_control_demands_are_believed(flying):
    assert fly_with(flying, HOVER, lambda _: (1.0, 0.0, 1.0), 0.5) == []
    # Down at 0.5 m/s^2, which makes 0.15 m in 0.77 s.
    states = fly_with(
        flying, (0.0, 0.0, 0.0, G - 0.5), lambda t: (1.0, 0.0, 1.0 - 0.25 * t * t), 1.0
    )
    assert 10 < len(states) < 30
    assert states[-1].z == pytest.approx(0.75, abs=0.02)


def test_outliers_in_flight_do_not_delay_the_pose_that_comes_back(flying):
    random = Random(1)

    def near(x):
        return lambda _: (random.gauss(x, 0.0005), 0.0, 1.0)

    fly_with(flying, HOVER, near(0.0), 1.0)
    assert fly_with(flying, HOVER, near(1.0), 0.25) == []
    assert len(fly_with(flying, HOVER, near(0.0), 0.2)) >= 17


def test_poses_with_nearly_the_same_stamp_are_no_speed():
    process = launch()
    hover(process, 0.5)
    before = len(process.published("/state"))
    for k in range(50):
        # Every other one is late, has a stamp 0.1 ms after that of the one before, and is 1 cm off.
        late = k % 2 == 1
        pose = transform(process, (0.01 * late, 0.0, 1.0))
        pose.header.stamp = process.clock.stamp(process.clock.time() - 0.0099 * late)
        process.publish("/tf", TFMessage([pose]))
        process.advance(0.01)
    states = [message.state for message in process.published("/state")[before:]]
    assert len(states) == 50
    assert max(abs(state.x_dot) for state in states) <= 2.0


def test_poses_that_jump_to_and_fro_are_not_believed():
    process = launch()
    hover(process, 0.5)
    before = len(process.published("/state"))
    rng = np.random.default_rng(1)
    fly(process, lambda elapsed: ((5.0, *rng.uniform(2.0, 9.0, 2)), (0.0, 0.0, 0.0)), 2.0)
    assert len(process.published("/state")) == before


def test_a_pose_from_the_future_does_not_silence_it():
    process = launch()
    hover(process, 0.5)
    early = transform(process, (0.0, 0.0, 1.0))
    early.header.stamp = process.clock.stamp(process.clock.time() + 8.0)
    process.publish("/tf", TFMessage([early]))
    assert len(hover(process, 0.5)) == 50
    assert rejected(process)["is stamped in the future"] == 1


def test_stamps_that_step_back_do_not_silence_it():
    process = launch()
    hover(process, 5.0)
    before = len(process.published("/state"))
    for _ in range(50):
        late = transform(process, (0.0, 0.0, 1.0))
        late.header.stamp = process.clock.stamp(process.clock.time() - 3.0)
        process.publish("/tf", TFMessage([late]))
        process.advance(0.01)
    states = [message.state for message in process.published("/state")[before:]]
    assert len(states) >= 45
    assert max(abs(state.z_dot) for state in states) < 1e-9
    assert rejected(process)["is stamped in the past"] == 2


@pytest.mark.parametrize("kind", ["finite_difference", "kalman"])
@pytest.mark.parametrize(
    "step", [sign * step for step in (0.05, 0.08, 0.15, 1.0, 3600.0, 86400.0) for sign in (-1, 1)]
)
@pytest.mark.parametrize("is_under_way", [True, False])
def test_no_velocity_is_calculated_from_two_clocks(step, is_under_way, kind):
    process = launch(**{"filter/type": kind})
    process.clock.wall_offset = 1.7e9

    def moving_from(begin):
        return lambda elapsed: ((begin + elapsed, 0.0, 1.0), (0.0, 0.0, 0.0))

    fly(process, moving_from(0.0), 1.0)
    pose = transform(process, (1.0, 0.0, 1.0))
    process.clock.wall_offset += step
    if is_under_way:
        process.publish("/tf", TFMessage([pose]))
    process.advance(0.01)
    before = len(process.published("/state"))
    fly(process, moving_from(1.01), 1.0)
    speeds = [message.state.x_dot for message in process.published("/state")[before:]]
    # A step back by less than 0.1 s costs the poses of so much time.
    assert len(speeds) > 85
    assert all(0.8 < speed < 1.2 for speed in speeds)


def test_when_nothing_good_comes_it_is_silent_and_says_why():
    process = launch()
    hover(process, 0.5)
    before = len(process.published("/state"))
    for _ in range(100):
        process.publish("/tf", TFMessage([transform(process, (math.nan, 0.0, 0.0))]))
        process.advance(0.01)
    assert len(process.published("/state")) == before
    assert rejected(process)["is not finite"] == 100
    (status,) = process.published("/diagnostics")[-1].status
    assert status.level == 2
    assert "no state for" in status.message
    assert any("poses were rejected" in text for text in process.logged("warn"))


# Tipping over.


def tilted(process):
    told = [message.is_tilted for message in process.published("/state_status")]
    return [new for old, new in zip([None, *told], told, strict=False) if new != old]


@pytest.mark.parametrize(
    ("attitude", "is_crash"),
    [
        ((1.04, 0.0, 2.0), False),
        ((0.0, -1.06, 0.5), True),
        ((1.06, 0.0, 0.0), True),
        ((0.9, 0.9, 0.0), True),
        ((3.1, 0.0, 0.0), True),
        ((0.0, 0.0, 3.0), False),
    ],
)
def test_tells_when_the_vehicle_has_tipped_over_and_when_it_stands_again(attitude, is_crash):
    process = launch()
    hover(process, 0.1)
    hover(process, 0.1, attitude=attitude)
    hover(process, 0.1)
    assert tilted(process) == [False, True, False] if is_crash else [False]


def test_a_marker_that_was_mistaken_is_no_crash():
    process = launch()
    for _ in range(10):
        hover(process, 0.1)
        hover(process, 0.02, attitude=(2.0, 0.0, 0.0))
    assert tilted(process) == [False]
