"""What is published of poses and estimate beside the state."""

import math

import numpy as np
import pytest
from estimator_helpers import fly, launch, transform
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped, EstimateStatus
from crazyflie_state_estimator.control_response import LAG

G = 9.81
LEVEL = (0.0, 0.0, 0.0)


def last(process):
    return process.published("/state_status")[-1]


def show(process, position, acceleration, duration):
    """Broadcast ``position(elapsed)`` while a control accelerates."""
    for k in range(round(100 * duration)):
        control = Control(thrust=G + acceleration)
        process.publish("/control/final", ControlStamped(control=control))
        process.publish("/tf", TFMessage([transform(process, position(0.01 * k))]))
        process.advance(0.01)


def test_before_the_first_pose_it_is_missing():
    process = launch()
    process.advance(1.0)
    status = last(process)
    assert (status.pose, status.header.stamp.to_sec()) == (EstimateStatus.MISSING, 0.0)
    assert status.reason
    assert all(math.isnan(each) for each in status.disturbance)


@pytest.mark.parametrize("acts_on_arrival", [False, True])
def test_it_is_published_twice_a_second_with_the_stamp_of_the_last_good_pose(acts_on_arrival):
    process = launch(act_on_arrival=acts_on_arrival)
    fly(process, lambda _: ((0.0, 0.0, 1.0), LEVEL), 0.5)
    before = len(process.published("/state_status"))
    fly(process, lambda _: ((0.0, 0.0, 1.0), LEVEL), 2.0)
    assert len(process.published("/state_status")) - before == pytest.approx(4, abs=1)
    status = last(process)
    assert (status.pose, status.reason, status.is_tilted) == (EstimateStatus.GOOD, "", False)
    assert status.header.frame_id == "world"
    last_pose = process.published("/state")[-1].header.stamp
    assert 0.0 <= (last_pose - status.header.stamp).to_sec() < 0.51


@pytest.mark.parametrize("acts_on_arrival", [False, True])
def test_poses_that_do_not_come_after_a_reset_of_time_are_missing(acts_on_arrival):
    """They were good for as long as time had been set back by."""
    process = launch(act_on_arrival=acts_on_arrival)
    fly(process, lambda _: ((0.0, 0.0, 1.0), LEVEL), 0.5)
    process.clock.set(1.0)
    process.advance(1.0)
    assert last(process).pose == EstimateStatus.MISSING
    assert last(process).reason == (
        "no transform of frame crazyflie has come since time was set back"
    )


@pytest.mark.parametrize("acts_on_arrival", [False, True])
def test_poses_that_stop_are_missing_and_come_again(acts_on_arrival):
    process = launch(act_on_arrival=acts_on_arrival)
    fly(process, lambda _: ((0.0, 0.0, 1.0), LEVEL), 0.5)
    process.advance(0.4)
    assert last(process).pose == EstimateStatus.GOOD
    process.advance(0.3)
    assert last(process).pose == EstimateStatus.MISSING
    assert "world -> crazyflie" in last(process).reason
    fly(process, lambda _: ((0.0, 0.0, 1.0), LEVEL), 0.5)
    assert last(process).pose == EstimateStatus.GOOD


def test_a_pose_that_the_vehicle_cannot_have_flown_to_is_told_of_at_once():
    process = launch()
    fly(process, lambda _: ((0.0, 0.0, 1.0), LEVEL), 0.5)
    good = process.published("/state")[-1].header.stamp
    fly(process, lambda _: ((2.0, 0.0, 1.0), LEVEL), 0.01)
    assert last(process).pose == EstimateStatus.IMPOSSIBLE
    assert last(process).header.stamp == good
    assert "crazyflie cannot have flown" in last(process).reason
    # Once nothing comes any more, that is the reason.
    process.advance(1.0)
    assert last(process).pose == EstimateStatus.MISSING


def test_poses_that_freeze_repeat_and_noisy_ones_do_not_respond():
    process = launch(**{"topics/control": "/control/final"})
    fly(process, lambda _: ((0.0, 0.0, 0.0), LEVEL), 0.5)
    random = np.random.default_rng(1)

    def near(height):
        return lambda t: random.normal((0.0, 0.0, height(t)), 0.001)

    show(process, near(lambda t: 0.5 * t * t), 1.0, 1.0)
    show(process, near(lambda t: 0.5 + t - 0.5 * t * t), -1.0, 1.0)
    show(process, near(lambda t: 1.0), 0.0, 2.0)
    assert {each.pose for each in process.published("/state_status")} == {EstimateStatus.GOOD}
    show(process, lambda t: (0.0, 0.0, 1.0), 0.0, 0.1)
    assert last(process).pose == EstimateStatus.REPEATED
    show(process, near(lambda t: 1.0), 2.0, 1.5)
    assert last(process).pose == EstimateStatus.NOT_RESPONDING
    assert "is motion capture frozen?" in last(process).reason


def test_the_disturbance_is_that_of_a_heavy_vehicle_in_the_wind():
    process = launch(**{"topics/control": "/control/final"})
    fly(process, lambda _: ((0.0, 0.0, 0.0), LEVEL), 0.5)
    # It needs 1.2 m/s^2 more than a nominal one; the wind takes it along.
    show(process, lambda t: (0.1 * t * t, 0.0, 0.4 * t * t), 2.0, 20 * LAG)
    x, y, z = last(process).disturbance
    assert (x, y, z) == pytest.approx((0.2, 0.0, -1.2), abs=0.1)


def test_a_vehicle_that_has_tipped_over():
    process = launch()
    fly(process, lambda _: ((0.0, 0.0, 0.1), LEVEL), 0.3)
    fly(process, lambda _: ((0.0, 0.0, 0.1), (2.0, 0.0, 0.0)), 0.3)
    assert last(process).is_tilted
    assert last(process).pose == EstimateStatus.GOOD
