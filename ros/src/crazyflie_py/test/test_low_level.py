"""Setpoints, the clock and the options of --sim."""

import math

import numpy as np
import pytest
from sim import hovering, positions, simulated


def test_a_full_state_is_where_the_vehicle_is():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    state = [0.2, 0.3, 1.1], [0.1, 0.2, 0.3], [0.4, 0.5, 0.6]
    one.cmdFullState(*state, 0.7, [0.0, 0.0, 0.1])
    swarm.timeHelper.sleep(0.1)
    found = one.position(), one.velocity(), one.acceleration()
    assert np.array(found) == pytest.approx(np.array(state))
    assert one.yaw() == pytest.approx(0.7)


def test_a_full_state_is_broadcast():
    swarm = hovering()
    zero = np.zeros(3)
    swarm.allcfs.cmdFullState([0.0, 0.0, 1.5], zero, zero, 0.0, zero)
    swarm.timeHelper.sleep(0.1)
    assert positions(swarm) == pytest.approx(np.array([[0.0, 0.0, 1.5]] * 2))


def test_a_position_is_reached():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.cmdPosition([0.5, 0.1, 1.2], yaw=0.4)
    swarm.timeHelper.sleep(0.2)
    assert one.position() == pytest.approx([0.5, 0.1, 1.2])
    assert one.yaw() == pytest.approx(0.4)
    assert one.velocity() == pytest.approx([0.0, 0.0, 0.0])


def test_a_velocity_is_integrated_and_turns_counter_clockwise():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.cmdVelocityWorld([0.5, -0.2, 0.1], yawRate=90.0)
    swarm.timeHelper.sleep(2.0)
    assert one.position() == pytest.approx([2.0, -0.4, 1.2])
    assert one.velocity() == pytest.approx([0.5, -0.2, 0.1])
    assert one.yaw() == pytest.approx(math.pi)


def test_hover_flies_where_the_vehicle_faces():
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.cmdPosition([0.0, 0.0, 1.0], yaw=math.pi / 2)
    swarm.timeHelper.sleep(0.1)
    one.cmdHover(0.5, 0.0, 0.0, 0.8)
    swarm.timeHelper.sleep(1.0)
    assert one.position() == pytest.approx([0.0, 0.5, 0.8])


def test_maxvel_limits_velocities_and_steps():
    swarm = hovering("--maxvel 1.0")
    one, two = swarm.allcfs.crazyflies
    one.cmdVelocityWorld([3.0, 4.0, 0.0], 0.0)
    two.cmdPosition([-3.0, 0.0, 1.0])
    swarm.timeHelper.sleep(1.0)
    assert one.velocity() == pytest.approx([0.6, 0.8, 0.0])
    assert one.position() == pytest.approx([1.6, 0.8, 1.0])
    assert two.position() == pytest.approx([-2.0, 0.0, 1.0])
    swarm.timeHelper.sleep(1.5)
    assert two.position() == pytest.approx([-3.0, 0.0, 1.0])


def test_disturbances_are_integrated():
    np.random.seed(1)
    swarm = hovering("--disturbance 0.5 --dt 0.01")
    one, two = swarm.allcfs.crazyflies
    one.cmdVelocityWorld([0.0, 0.0, 0.0], 0.0)
    swarm.timeHelper.sleep(4.0)
    # A random walk: 0.5 m/s * sqrt(400) * 0.01 s is its standard deviation.
    offset = one.position() - [1.0, 0.0, 1.0]
    assert 0.001 < np.min(np.abs(offset))
    assert np.max(np.abs(offset)) < 0.4
    assert two.position() == pytest.approx([-1.0, 0.0, 1.0])


def test_commands_follow_after_notify_setpoints_stop(caplog):
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.cmdVelocityWorld([0.0, 0.5, 0.0], 0.0)
    swarm.timeHelper.sleep(0.4)
    one.notifySetpointsStop(remainValidMillisecs=200)
    swarm.timeHelper.sleep(1.0)
    # The last setpoint remains valid for 0.2 s.
    assert one.position() == pytest.approx([1.0, 0.3, 1.0])
    one.land(0.02, 1.0)
    swarm.timeHelper.sleep(1.0)
    assert one.position() == pytest.approx([1.0, 0.3, 0.02], abs=1e-4)
    assert not caplog.records


def test_commands_without_it_are_reported(caplog):
    swarm = hovering()
    one = swarm.allcfs.crazyflies[0]
    one.cmdPosition([0.0, 0.0, 1.0])
    swarm.timeHelper.sleep(0.1)
    one.goTo([0.0, 0.0, 0.5], 0.0, 1.0)
    swarm.timeHelper.sleep(1.0)
    assert one.position() == pytest.approx([0.0, 0.0, 0.5], abs=1e-4)
    assert "cf1.goTo: setpoints were not ended by notifySetpointsStop" in caplog.text


def test_setpoints_that_are_not_repeated_are_reported_once(caplog):
    swarm = hovering()
    one, two = swarm.allcfs.crazyflies
    one.cmdVelocityWorld([0.1, 0.0, 0.0], 0.0)
    for _ in range(10):
        two.cmdVelocityWorld([0.1, 0.0, 0.0], 0.0)
        swarm.timeHelper.sleepForRate(10.0)
    assert [r.getMessage()[:35] for r in caplog.records] == ["cf1: no setpoint for 0.5 s; a real "]


@pytest.mark.parametrize("seed", range(20))
def test_time_passes_in_steps_and_the_rest_of_a_sleep_counts_later(seed):
    generator = np.random.default_rng(seed)
    step, pause = 10.0 ** generator.uniform(-2, 0, size=2)
    swarm = simulated(f"--dt {step}")
    helper, one = swarm.timeHelper, swarm.allcfs.crazyflies[0]
    one.cmdVelocityWorld([1.0, 0.0, 0.0], 0.0)
    asked = 0.0
    while asked < 2.0:
        helper.sleep(pause)
        asked += pause
        assert -1e-9 <= asked - helper.time() < step + 1e-9
        assert one.position()[0] == pytest.approx(1.0 + helper.time())


def test_sleeps_of_whole_steps_are_not_lost_to_rounding():
    helper = simulated("--dt 0.1").timeHelper
    for n in range(1, 100):
        helper.sleep(0.3)
        assert helper.time() == pytest.approx(0.3 * n)
    assert helper.dt == 0.1
    assert not helper.isShutdown()


def test_csv_files_have_the_flight(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    swarm = simulated("--writecsv")
    swarm.timeHelper.nextPhase()
    swarm.allcfs.takeoff(1.0, 2.0)
    swarm.timeHelper.sleep(2.5)
    swarm.timeHelper.nextPhase()
    assert (tmp_path / "cf1_phase1.csv").read_text().startswith("# t,x,y,z,roll,pitch,yaw\n")
    data = np.loadtxt("cf2_phase1.csv", delimiter=",")
    assert data.shape == (25, 7)
    assert data[:, 0] == pytest.approx(0.1 * np.arange(25))
    assert data[-1, 1:4] == pytest.approx([-1.0, 0.0, 1.0])
