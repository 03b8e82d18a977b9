"""Poses that repeat or do not follow the control, by themselves and in the node."""

import math

import numpy as np
import pytest
from estimator_helpers import fly, launch

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_state_estimator.frozen_poses import FrozenPoseMonitor

LEVEL = (0.0, 0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)
PERIOD = 0.01


class Camera:
    """Poses of a vehicle, 100 a second, with noise."""

    def __init__(self, noise=0.0, knows_control=True):
        self.monitor = FrozenPoseMonitor(knows_control)
        self.random = np.random.default_rng(1)
        self.noise = noise
        self.time = 0.0

    def show(self, position, acceleration, duration=PERIOD, rotation=LEVEL):
        """Show poses; ``position`` may be a function of the time; return what is said of each."""
        verdicts = []
        for _ in range(round(duration / PERIOD)):
            self.time += PERIOD
            there = position(self.time) if callable(position) else position
            seen = [each + self.noise * self.random.normal() for each in there]
            verdicts.append(self.monitor.update(self.time, seen, rotation, acceleration))
        return verdicts

    def lift(self, speed=0.4):
        """Stand with motors off, and climb to 1 m."""
        self.show((0.0, 0.0, 0.0), None, 1.0)
        begin = self.time
        assert not any(self.show(lambda t: (0.0, 0.0, speed * (t - begin)), STILL, 1.0 / speed))
        assert not any(self.show((0.0, 0.0, 1.001), STILL))
        return self


def test_a_pose_that_repeats_in_flight_is_none():
    camera = Camera().lift()
    assert camera.show((0.0, 0.0, 1.001), STILL, 3.0) == [True] * 300
    assert camera.show((0.0, 0.0, 1.002), STILL) == [False]


def test_it_is_none_either_when_the_motors_have_stopped_meanwhile():
    camera = Camera().lift()
    camera.show((0.0, 0.0, 1.001), STILL, 1.0)
    assert all(camera.show((0.0, 0.0, 1.001), None, 9.0))
    assert not any(camera.show((0.0, 0.0, 0.0), None, 1.0))


def test_another_attitude_is_another_pose():
    camera = Camera().lift()
    assert camera.show((0.0, 0.0, 1.001), STILL, rotation=(0.0, 0.0, 1e-9, 1.0)) == [False]


def test_on_the_ground_poses_repeat():
    camera = Camera().lift()
    assert not any(camera.show(lambda t: (0.0, 0.0, max(0.0, 1.0 - 0.1 * t)), STILL, 15.0))
    assert not any(camera.show((0.0, 0.0, 0.0), STILL, 5.0))
    assert not any(camera.show((0.0, 0.0, 0.0), None, 5.0))


def test_a_simulated_hover_that_converges_repeats_in_the_end():
    camera = Camera().lift()
    begin = camera.time
    assert not any(
        camera.show(lambda t: (0.0, 0.0, 1.0 + math.exp(-3.0 * (t - begin))), STILL, 30.0)
    )


def test_before_its_first_control_a_simulated_vehicle_stays_in_the_air():
    camera = Camera()
    assert not any(camera.show((0.0, 0.0, 1.0), None, 5.0))
    assert not any(camera.show((0.0, 0.0, 1.0), STILL, 5.0))


def test_without_controls_poses_that_repeat_are_told_by_their_last_motion():
    camera = Camera(knows_control=False)
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    assert not any(camera.show(lambda t: (0.0, 0.0, 0.4 * (t - 1.0)), None, 2.0))
    assert camera.show((0.0, 0.0, 0.801), None, 0.1)[1:] == [True] * 9


@pytest.mark.parametrize(("thrust", "is_frozen"), [(2.2, False), (3.6, True), (6.2, True)])
def test_what_lifts_any_vehicle_does_not_leave_it_on_the_ground(thrust, is_frozen):
    camera = Camera()
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    assert any(camera.show((0.0, 0.0, 0.0), (0.0, 0.0, thrust), 2.0)) == is_frozen


# The same pose, with noise.


@pytest.mark.parametrize("noise", [0.0002, 0.001, 0.003])
@pytest.mark.parametrize(
    "acceleration", [(2.0, 0.0, 0.0), (0.0, -2.0, 0.0), (0.0, 0.0, 2.0), (1.2, 1.2, -0.3)]
)
def test_a_place_that_does_not_answer_to_the_control_is_none(noise, acceleration):
    camera = Camera(noise).lift()
    hover = (0.0, 0.0, 1.0)
    assert not any(camera.show(hover, STILL, 5.0))
    verdicts = camera.show(hover, acceleration, 2.0)
    assert not any(verdicts[:20])
    assert all(verdicts[-20:])
    assert all(camera.show(hover, acceleration, 30.0))
    # The camera goes on.
    assert not any(camera.show((0.3, 0.0, 0.5), STILL, 3.0)[2:])


@pytest.mark.parametrize("disturbance", [(0.0, 0.0, -3.0), (1.3, -1.3, 0.5)])
def test_a_vehicle_that_is_heavy_or_in_the_wind_is_believed(disturbance):
    camera = Camera(0.001)
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    balance = [-each for each in disturbance]
    for step in range(20):
        camera.show((0.0, 0.0, 0.0), [0.05 * step * each for each in balance], 0.1)
    begin = camera.time
    assert not any(camera.show(lambda t: (0.0, 0.0, 0.4 * (t - begin)), balance, 2.5))
    assert not any(camera.show((0.0, 0.0, 1.0), balance, 60.0))


def test_wind_that_rises_slowly_is_believed():
    camera = Camera(0.001).lift()
    for step in range(600):
        assert not any(camera.show((0.0, 0.0, 1.0), (0.0025 * step, 0.0, 0.0), 0.1))


def test_a_vehicle_that_stands_on_a_table_with_less_thrust_is_believed():
    camera = Camera(0.001).lift()
    camera.show((0.0, 0.0, 1.0), STILL, 5.0)
    assert not any(camera.show((0.0, 0.0, 0.5), (1.0, 1.0, -2.0), 3.0))


# In the node.


def command(process, thrust):
    process.publish("/control/final", ControlStamped(control=Control(thrust=thrust)))


@pytest.mark.parametrize("filter_type", ["finite_difference", "kalman"])
def test_a_frozen_camera_gives_no_states_and_the_node_says_so(filter_type):
    process = launch(**{"topics/control": "/control/final", "filter/type": filter_type})
    fly(process, lambda elapsed: ((0.0, 0.0, 0.0), STILL), 0.5)
    for tick in range(100):
        command(process, 9.81)
        fly(process, lambda _, tick=tick: ((0.0, 0.0, 0.004 * tick), STILL), 0.01)
    before = len(process.published("/state"))
    for _ in range(100):
        command(process, 9.81)
        fly(process, lambda _: ((0.0, 0.0, 0.396), STILL), 0.01)
    assert len(process.published("/state")) == before
    assert any("is motion capture frozen?" in text for text in process.logged("warn"))
    (status,) = process.published("/diagnostics")[-1].status
    counted = {pair.key: int(pair.value) for pair in status.values}
    assert counted["rejected: does not follow the control"] > 40
    fly(process, lambda elapsed: ((0.0, 0.0, 0.37 - 0.1 * elapsed), STILL), 0.1)
    assert len(process.published("/state")) > before + 5
