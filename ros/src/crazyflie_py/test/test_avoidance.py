"""Collision avoidance in --sim."""

import numpy as np
import pytest
from pycrazyswarm.util import check_ellipsoid_collisions, grid_yaml, poisson_disk_sample
from sim import hovering, positions, simulated

RADII = np.array([0.125, 0.125, 0.375])


def avoid_each_other(swarm, radii=RADII, **settings):
    """Enable avoidance of all vehicles by each vehicle."""
    vehicles = swarm.allcfs.crazyflies
    for cf in vehicles:
        cf.enableCollisionAvoidance(vehicles, radii, **settings)


def collisions(swarm, duration, radii=RADII):
    """Advance the time (s); return whether ellipsoids have intersected."""
    end = swarm.timeHelper.time() + duration
    found = False
    while swarm.timeHelper.time() < end - 1e-6:
        swarm.timeHelper.sleep(swarm.timeHelper.dt)
        found |= bool(np.any(check_ellipsoid_collisions(positions(swarm), radii)))
    return found


def swap(swarm, send):
    """Send two vehicles to each other's place."""
    for cf, goal in zip(swarm.allcfs.crazyflies, positions(swarm)[::-1], strict=True):
        send(cf, goal)


def go_to(cf, goal):
    """Send a command."""
    cf.goTo(goal, 0.0, 5.0)


@pytest.mark.parametrize("dt", [0.01, 0.1])
def test_two_that_swap_pass_each_other_and_arrive(dt):
    swarm = hovering(f"--dt {dt}")
    goals = positions(swarm)[::-1]
    avoid_each_other(swarm)
    swap(swarm, go_to)
    assert not collisions(swarm, 5.0)
    assert positions(swarm) == pytest.approx(goals, abs=1e-4)


def test_smaller_ellipsoids_come_closer():
    swarm = hovering()
    radii = np.array([0.1, 0.1, 0.3])
    avoid_each_other(swarm, radii)
    swap(swarm, go_to)
    closest = 9.0
    for _ in range(60):
        assert not collisions(swarm, 0.1, radii)
        closest = min(closest, float(np.linalg.norm(np.diff(positions(swarm), axis=0))))
    assert 0.2 <= closest < 0.25


def test_position_setpoints_are_avoided():
    swarm = hovering("--maxvel 1.0")
    goals = positions(swarm)[::-1] + [0.0, 0.0, 1.0]
    avoid_each_other(swarm)
    swap(swarm, lambda cf, goal: cf.cmdPosition(goal + [0.0, 0.0, 1.0]))
    assert not collisions(swarm, 7.5)
    assert positions(swarm) == pytest.approx(goals, abs=1e-6)


def test_velocity_setpoints_sidestep_to_the_right():
    swarm = simulated("--dt 0.05 --maxvel 1.0")
    one, two = swarm.allcfs.crazyflies
    avoid_each_other(swarm)
    one.cmdVelocityWorld([-1.0, 0.0, 0.0], 0.0)
    two.cmdVelocityWorld([1.0, 0.0, 0.0], 0.0)
    assert not collisions(swarm, 6.0)
    assert one.position()[0] < -1.0 < 1.0 < two.position()[0]
    assert one.position()[1] > 0.1 > -0.1 > two.position()[1]


def test_the_box_is_not_left():
    swarm = hovering("--maxvel 1.0")
    low, high = [-1.5, -1.0, 0.0], [4.0, 1.0, 2.0]
    avoid_each_other(swarm, bboxMin=low, bboxMax=high)
    one, two = swarm.allcfs.crazyflies
    one.cmdPosition([3.0, 0.0, 1.0])
    two.cmdPosition([-3.0, 0.0, 1.0])
    for _ in range(40):
        swarm.timeHelper.sleep(0.1)
        assert np.all(positions(swarm) >= low)
        assert np.all(positions(swarm) <= high)
    assert one.position() == pytest.approx([3.0, 0.0, 1.0])
    # Before a wall of the box, as before another vehicle, it steps aside.
    assert two.position() == pytest.approx([-1.5, 1.0, 1.0])


def test_max_speed_limits_each_axis():
    swarm = hovering()
    one, two = swarm.allcfs.crazyflies
    one.enableCollisionAvoidance([two], RADII, maxSpeed=0.0)
    two.enableCollisionAvoidance([one], RADII, maxSpeed=0.5)
    one.cmdPosition([0.0, 2.0, 1.0])
    two.cmdVelocityWorld([0.0, 2.0, -0.1], 0.0)
    swarm.timeHelper.sleep(1.0)
    assert np.all(one.velocity() == 0.0)
    assert one.position() == pytest.approx([1.0, 0.0, 1.0])
    assert two.velocity() == pytest.approx([0.0, 0.5, -0.1], abs=1e-5)


def test_avoidance_ends():
    swarm = hovering()
    avoid_each_other(swarm)
    for cf in swarm.allcfs.crazyflies:
        cf.disableCollisionAvoidance()
    swap(swarm, go_to)
    assert collisions(swarm, 5.0)


def test_vehicles_at_one_place_do_not_fail():
    swarm = simulated(fleet=grid_yaml(2, 1, spacing=0.0))
    avoid_each_other(swarm)
    swarm.allcfs.takeoff(1.0, 1.0)
    swarm.timeHelper.sleep(1.0)
    assert np.all(np.isfinite(positions(swarm)))


def test_many_reach_random_goals_without_a_collision():
    np.random.seed(0)
    n = 15
    swarm = hovering(fleet=grid_yaml(3, 5))
    avoid_each_other(swarm)
    for _ in range(2):
        flat = poisson_disk_sample(n, dim=2, mindist=0.625)
        goals = np.column_stack([flat, 1.0 + 0.2 * np.random.uniform(-1.0, 1.0, n)])
        for cf, goal in zip(swarm.allcfs.crazyflies, goals, strict=True):
            go_to(cf, goal)
        assert not collisions(swarm, 20.0)
        assert positions(swarm) == pytest.approx(goals, abs=1e-4)
