"""Commands of the high-level commander in --sim."""

import math

import numpy as np
import pytest
from sim import PAIR, hovering, positions, simulated, starts
from uav_trajectory import Polynomial4D, Trajectory

ATOL = 1e-4


def line(distance, duration=2.0):
    """Return a trajectory along x with constant speed, m and s, that begins at x = 3 m."""
    trajectory = Trajectory()
    trajectory.polynomials = [Polynomial4D(duration, [3.0, distance / duration], [0], [1], [0])]
    trajectory.duration = duration
    return trajectory


def test_a_takeoff_ends_at_its_height_and_does_not_block():
    swarm = simulated()
    swarm.allcfs.takeoff(targetHeight=0.7, duration=2.0)
    assert positions(swarm) == pytest.approx(starts(swarm))
    swarm.timeHelper.sleep(1.0)
    # Half of the time is half of the height on a curve that is symmetrical.
    assert positions(swarm)[:, 2] == pytest.approx(0.35, abs=ATOL)
    swarm.timeHelper.sleep(1.0)
    assert positions(swarm) == pytest.approx(starts(swarm) + [0, 0, 0.7], abs=ATOL)


def test_a_landing_ends_at_its_height_and_stops_the_motors():
    swarm = hovering()
    swarm.allcfs.land(targetHeight=0.02, duration=2.0)
    swarm.timeHelper.sleep(2.0)
    assert positions(swarm) == pytest.approx(starts(swarm) + [0, 0, 0.02], abs=ATOL)
    assert not swarm.allcfs.crazyflies[0].get_status()["supervisor"] & 1 << 4


def test_go_to_is_absolute_for_one_vehicle():
    swarm = hovering()
    one, two = swarm.allcfs.crazyflies
    one.goTo([0.5, 1.0, 1.5], yaw=1.0, duration=3.0)
    swarm.timeHelper.sleep(3.0)
    assert one.position() == pytest.approx([0.5, 1.0, 1.5], abs=ATOL)
    assert one.yaw() == pytest.approx(1.0, abs=ATOL)
    assert two.position() == pytest.approx([-1.0, 0.0, 1.0], abs=ATOL)


def test_go_to_is_relative_for_all():
    swarm = hovering()
    swarm.allcfs.goTo((0.0, 0.5, 0.2), 0.3, 2.0)
    swarm.timeHelper.sleep(2.0)
    assert positions(swarm) == pytest.approx(starts(swarm) + [0, 0.5, 1.2], abs=ATOL)
    assert swarm.allcfs.crazyflies[1].yaw() == pytest.approx(0.3, abs=ATOL)


def test_go_to_is_relative_to_the_plan_with_its_velocity():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.goTo([1.0, 0.0, 1.0], 0.0, 2.0, relative=True)
    swarm.timeHelper.sleep(1.0)
    before, velocity = one.position(), one.velocity()
    one.goTo([0.0, 1.0, 0.0], 0.0, 2.0, relative=True)
    swarm.timeHelper.sleep(0.1)
    assert np.linalg.norm(velocity) > 0.5
    assert one.velocity() == pytest.approx(velocity, abs=0.2)
    swarm.timeHelper.sleep(1.9)
    assert one.position() == pytest.approx(before + [0.0, 1.0, 0.0], abs=ATOL)
    assert one.velocity() == pytest.approx(0.0, abs=ATOL)


@pytest.mark.parametrize("heading", [-2.0, 0.0, 1.3])
@pytest.mark.parametrize(("ahead", "angle", "sign"), [(1, 1, 1), (0, 0, -1)])
def test_vehicles_tilt_where_they_accelerate(heading, ahead, angle, sign):
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.goTo([0, 0, 0], heading, 1.0, relative=True)
    swarm.timeHelper.sleep(1.0)
    c, s = math.cos(heading), math.sin(heading)
    one.goTo([c, s, 0.0] if ahead else [-s, c, 0.0], 0.0, 1.0, relative=True)
    swarm.timeHelper.sleep(0.3)
    rpy = one.rpy()
    assert sign * rpy[angle] > 0.3
    assert rpy[1 - angle] == pytest.approx(0.0, abs=1e-6)
    assert rpy[2] == pytest.approx(heading, abs=1e-6)


def test_a_trajectory_is_flown_from_where_the_vehicle_is_unless_it_is_absolute():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.uploadTrajectory(0, 0, line(1.0))
    one.startTrajectory(0)
    swarm.timeHelper.sleep(1.0)
    assert one.position() == pytest.approx([1.5, 0.0, 1.0], abs=ATOL)
    assert one.velocity() == pytest.approx([0.5, 0.0, 0.0], abs=ATOL)
    one.startTrajectory(0, relative=False)
    swarm.timeHelper.sleep(2.0)
    assert one.position() == pytest.approx([4.0, 0.0, 1.0], abs=ATOL)
    assert one.velocity() == pytest.approx([0.0, 0.0, 0.0])


def test_a_trajectory_is_scaled_and_reversed():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.uploadTrajectory(0, 0, line(1.0))
    one.startTrajectory(0, timescale=0.5)
    swarm.timeHelper.sleep(1.0)
    assert one.position() == pytest.approx([2.0, 0.0, 1.0], abs=ATOL)
    one.startTrajectory(0, timescale=2.0, reverse=True)
    swarm.timeHelper.sleep(2.0)
    assert one.position() == pytest.approx([1.5, 0.0, 1.0], abs=ATOL)
    swarm.timeHelper.sleep(2.0)
    assert one.position() == pytest.approx([1.0, 0.0, 1.0], abs=ATOL)


def test_trajectories_lie_one_after_the_other_in_the_memory(caplog):
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.uploadTrajectory(0, 0, line(1.0))
    one.uploadTrajectory(1, 1, line(-0.5))
    assert not caplog.records
    for trajectory_id, distance in ((0, 1.0), (1, -0.5)):
        before = one.position()
        one.startTrajectory(trajectory_id)
        swarm.timeHelper.sleep(2.0)
        assert one.position() - before == pytest.approx([distance, 0.0, 0.0], abs=ATOL)
    one.uploadTrajectory(2, 0, line(0.2))
    assert "cf1.uploadTrajectory: pieces 0 to 0 overwrite trajectory 0" in caplog.text
    before = one.position()
    one.startTrajectory(0)
    swarm.timeHelper.sleep(2.0)
    assert one.position() - before == pytest.approx([0.2, 0.0, 0.0], abs=ATOL)


def test_a_broadcast_trajectory_keeps_the_formation():
    swarm = hovering()
    for cf in swarm.allcfs.crazyflies:
        cf.uploadTrajectory(100, 0, line(1.0))
    swarm.allcfs.startTrajectory(100)
    for _ in range(25):
        swarm.timeHelper.sleep(0.1)
        one, two = positions(swarm)
        assert one - two == pytest.approx([2.0, 0.0, 0.0], abs=ATOL)
    assert one == pytest.approx([2.0, 0.0, 1.0], abs=ATOL)


def test_groups_restrict_broadcasts():
    swarm = simulated()
    one, two = swarm.allcfs.crazyflies
    one.setGroupMask(0b01)
    two.setGroupMask(0b10)
    swarm.allcfs.takeoff(1.0, 2.0, groupMask=0b01)
    swarm.timeHelper.sleep(2.0)
    assert positions(swarm)[:, 2] == pytest.approx([1.0, 0.0], abs=ATOL)
    swarm.allcfs.takeoff(0.5, 2.0, groupMask=0b10)
    swarm.timeHelper.sleep(2.0)
    assert positions(swarm)[:, 2] == pytest.approx([1.0, 0.5], abs=ATOL)
    swarm.allcfs.goTo([0, 0, 0.3], 0.0, 1.0, groupMask=0b11)
    swarm.timeHelper.sleep(1.0)
    assert positions(swarm)[:, 2] == pytest.approx([1.3, 0.8], abs=ATOL)
    swarm.allcfs.land(0.0, 1.0, groupMask=0b100)
    swarm.timeHelper.sleep(1.0)
    assert positions(swarm)[:, 2] == pytest.approx([1.3, 0.8], abs=ATOL)


def test_a_vehicle_that_flies_does_not_take_off_again(caplog):
    swarm = hovering()
    swarm.allcfs.crazyflies[0].takeoff(2.0, 1.0)
    swarm.timeHelper.sleep(1.0)
    assert positions(swarm)[:, 2] == pytest.approx(1.0, abs=ATOL)
    assert "cf1.takeoff: the vehicle flies" in caplog.text


def test_motors_that_stop_in_the_air_are_reported(caplog):
    swarm = hovering()
    swarm.allcfs.crazyflies[0].stop()
    assert "cf1.stop: the motors stop 1.00 m above the start" in caplog.text
    assert "cf2" not in caplog.text
    swarm.allcfs.crazyflies[1].land(0.04, 1.0)
    swarm.timeHelper.sleep(1.0)
    swarm.allcfs.crazyflies[1].stop()
    assert "cf2" not in caplog.text


def test_nothing_has_an_effect_after_an_emergency():
    swarm = hovering()
    swarm.allcfs.emergency()
    before = positions(swarm)
    swarm.allcfs.goTo([1, 0, 0], 0.0, 1.0)
    swarm.allcfs.crazyflies[0].cmdPosition([0, 0, 1])
    swarm.timeHelper.sleep(1.0)
    assert positions(swarm) == pytest.approx(before)
    assert swarm.allcfs.crazyflies[0].get_status()["supervisor"] & 1 << 6


def test_vehicles_that_come_too_close_are_reported_once(caplog):
    swarm = hovering()
    one, two = swarm.allcfs.crazyflies
    one.goTo([-1.0, 0.0, 1.0], 0.0, 4.0)
    two.goTo([1.0, 0.0, 1.0], 0.0, 4.0)
    swarm.timeHelper.sleep(4.0)
    warnings = [record.getMessage() for record in caplog.records]
    assert len(warnings) == 1
    assert warnings[0].startswith("cf1 and cf2 are ")
    assert " apart at 3." in warnings[0]


def test_vehicles_on_the_ground_are_not_reported(caplog):
    swarm = simulated(fleet=PAIR.replace("-1.0", "1.0"))
    swarm.timeHelper.sleep(1.0)
    assert not caplog.records
