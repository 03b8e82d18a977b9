"""Poses that repeat or do not follow the control, by themselves and in the node."""

import math

import numpy as np
import pytest
from estimator_helpers import fly, launch

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_state_estimator.pose_monitor import PoseMonitor, Verdict

GOOD = (Verdict.GOOD, Verdict.MOVED)
LEVEL = (0.0, 0.0, 0.0, 1.0)
STILL = (0.0, 0.0, 0.0)
PERIOD = 0.01


class Camera:
    """Poses of a vehicle, 100 a second, with noise."""

    def __init__(self, noise=0.0, knows_control=True):
        self.monitor = PoseMonitor(5.0, knows_control)
        self.random = np.random.default_rng(1)
        self.noise = noise
        self.time = 0.0

    def show(self, position, acceleration, duration=PERIOD, rotation=LEVEL):
        """Show poses, a constant one or a function of the time; return whether each is rejected."""
        verdicts = []
        for _ in range(round(duration / PERIOD)):
            self.time += PERIOD
            there = position(self.time) if callable(position) else position
            seen = [each + self.noise * self.random.normal() for each in there]
            control = acceleration(self.time) if callable(acceleration) else acceleration
            verdict = self.monitor.update(self.time, seen, rotation, control)
            verdicts.append(verdict not in GOOD)
        return verdicts

    def move(self, height, balance=STILL, start=0.0, duration=2.5):
        """Show a move from one height to another one and stop there."""
        begin, half, rate = self.time, (height - start) / 2.0, math.pi / duration
        return self.show(
            lambda t: (0.0, 0.0, start + half * (1.0 - math.cos(rate * (t - begin)))),
            lambda t: (
                *balance[:2],
                balance[2] + half * rate * rate * math.cos(rate * (t - begin)),
            ),
            duration,
        )

    def lift(self):
        """Stand with motors off, and climb to 1 m."""
        self.show((0.0, 0.0, 0.0), None, 1.0)
        assert not any(self.move(1.0))
        assert not any(self.show((0.0, 0.0, 1.001), STILL))
        return self


def test_a_pose_that_repeats_in_flight_is_rejected():
    camera = Camera().lift()
    assert camera.show((0.0, 0.0, 1.001), STILL, 3.0) == [True] * 300
    assert camera.show((0.0, 0.0, 1.002), STILL) == [False]


def test_it_is_rejected_also_when_the_motors_have_stopped_meanwhile():
    camera = Camera().lift()
    camera.show((0.0, 0.0, 1.001), STILL, 1.0)
    assert all(camera.show((0.0, 0.0, 1.001), None, 9.0))
    # It is found on the ground.
    assert not any(camera.show((0.0, 0.0, 0.0), None, 1.0)[30:])


def test_another_attitude_is_another_pose():
    camera = Camera().lift()
    assert camera.show((0.0, 0.0, 1.001), STILL, rotation=(0.0, 0.0, 1e-9, 1.0)) == [False]


@pytest.mark.parametrize("noise", [0.0, 0.0003, 0.003])
def test_a_body_that_stays_on_the_ground_in_a_takeoff_is_another_one(noise):
    """With noise, a vehicle of which a body on the ground was shown rose to 43 m and more."""
    camera = Camera(noise)
    camera.show((0.0, 0.0, 0.3), None, 1.0)
    camera.show((0.0, 0.0, 0.3), (0.0, 0.0, 0.2), 1.0)
    verdicts = camera.show((0.0, 0.0, 0.3), (0.0, 0.0, 6.2), 0.6)
    assert verdicts[-1] and not any(verdicts[:5])
    # It was believed before it has come to 1 m.
    assert camera.show((0.0, 0.0, 0.3), None, 1.0) == [True] * 100
    # A person takes it in a hand.
    assert not any(camera.show((0.1, 0.0, 0.8), None, 1.0)[30:])


def test_where_a_vehicle_is_whose_poses_have_stayed_on_the_ground():
    camera = Camera(0.001)
    camera.show((1.0, 0.0, 0.0), None, 1.0)
    steps = 1
    while not any(camera.show((1.0, 0.0, 0.0), (0.0, 0.0, 6.2))):
        steps += 1
    position, velocity = camera.monitor.departure
    assert position == pytest.approx((1.0, 0.0, 3.1e-4 * steps * (steps + 1)), abs=0.01)
    assert velocity == pytest.approx((0.0, 0.0, 0.062 * steps))


def test_a_heavy_late_vehicle_lifts_off():
    """Its motors lag by 0.1 s and its poses by 0.06 s; it hovers at g + 3 m/s^2."""
    camera = Camera(0.001)
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    begin, thrust = camera.time, 6.2

    def height(time):
        t = max(time - begin - 0.06, 0.0)
        excess = 6.2 - 3.0
        return max(excess * (0.5 * t * t - 0.1 * t + 0.01 * (1.0 - math.exp(-t / 0.1))), 0.0)

    assert not any(camera.show(lambda t: (0.0, 0.0, height(t)), (0.0, 0.0, thrust), 0.7))


def test_on_the_ground_poses_repeat():
    camera = Camera().lift()
    assert not any(camera.move(0.0, start=1.001))
    assert not any(camera.show((0.0, 0.0, 0.0), STILL, 5.0))
    assert not any(camera.show((0.0, 0.0, 0.0), None, 5.0))


def test_a_simulated_hover_that_converges_repeats_in_the_end():
    camera = Camera().lift()
    begin = camera.time
    assert not any(
        camera.show(
            lambda t: (0.0, 0.0, 1.0 + 0.001 * math.exp(-3.0 * (t - begin))),
            lambda t: (0.0, 0.0, 0.009 * math.exp(-3.0 * (t - begin))),
            30.0,
        )
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
def test_poses_that_do_not_respond_to_the_control_are_rejected(noise, acceleration):
    camera = Camera(noise).lift()
    hover = (0.0, 0.0, 1.0)
    assert not any(camera.show(hover, STILL, 5.0))
    verdicts = camera.show(hover, acceleration, 2.0)
    assert not any(verdicts[:20])
    assert all(verdicts[-20:])
    assert all(camera.show(hover, acceleration, 30.0))
    # The camera goes on.
    assert not any(camera.show((0.04, 0.0, 0.96), STILL, 3.0)[2:])


@pytest.mark.parametrize("disturbance", [(0.0, 0.0, -3.0), (1.3, -1.3, 0.5)])
def test_a_vehicle_that_is_heavy_or_in_the_wind_is_believed(disturbance):
    camera = Camera(0.001)
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    balance = [-each for each in disturbance]
    for step in range(20):
        camera.show((0.0, 0.0, 0.0), [0.05 * step * each for each in balance], 0.1)
    assert not any(camera.move(1.0, balance))
    assert not any(camera.show((0.0, 0.0, 1.0), balance, 60.0))


def test_wind_that_rises_slowly_is_believed():
    camera = Camera(0.001).lift()
    for step in range(600):
        assert not any(camera.show((0.0, 0.0, 1.0), (0.0025 * step, 0.0, 0.0), 0.1))


def test_a_vehicle_that_stands_on_a_table_with_less_thrust_is_believed():
    camera = Camera(0.001).lift()
    camera.show((0.0, 0.0, 1.0), STILL, 5.0)
    begin = camera.time
    assert not any(camera.show(lambda t: (0.0, 0.0, 1.0 - (t - begin) ** 2), (0.0, 0.0, -2.0), 0.7))
    assert not any(camera.show((0.0, 0.0, 0.51), (1.0, 1.0, -2.0), 3.0))


def test_motion_that_ends_without_a_control_is_rejected():
    camera = Camera(0.001)
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    camera.move(1.0, duration=2.0)
    begin = camera.time
    slope = 0.3 * math.pi
    swing = camera.show(
        lambda t: (0.3 * math.sin(math.pi * (t - begin)), 0.0, 1.0),
        lambda t: (-slope * math.pi * math.sin(math.pi * (t - begin)), 0.0, 0.0),
        2.0,
    )
    assert not any(swing)
    verdicts = camera.show((0.0, 0.0, 1.0), STILL, 1.0)
    assert verdicts.index(True) < 60
    assert all(verdicts[60:])


def test_the_first_pose_that_does_not_respond_comes_with_the_predicted_motion():
    camera = Camera(0.001).lift()
    camera.show((0.0, 0.0, 1.0), STILL, 5.0)
    duration = 0.0
    while not camera.show((0.0, 0.0, 1.0), (0.0, 0.0, 2.0))[0]:
        duration += PERIOD
    position, velocity = camera.monitor.departure
    assert duration < 1.0
    # The vehicle's response lags behind.
    assert 0.4 < velocity[2] / (2.0 * duration) < 1.0
    assert 0.2 < (position[2] - 1.0) / duration**2 < 1.0
    camera.show((0.0, 0.0, 1.0), (0.0, 0.0, 2.0))
    assert camera.monitor.departure is None


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
    assert len(process.published("/state")) == before + 1  # The predicted one.
    assert any("is motion capture frozen?" in text for text in process.logged("warn"))
    (status,) = process.published("/diagnostics")[-1].status
    counted = {pair.key: int(pair.value) for pair in status.values}
    assert counted["rejected: does not follow the control"] > 40
    fly(process, lambda elapsed: ((0.0, 0.0, 0.37 - 0.1 * elapsed), STILL), 0.1)
    assert len(process.published("/state")) > before + 5


def test_the_last_state_before_the_silence_is_the_predicted_one():
    process = launch(**{"topics/control": "/control/final", "filter/type": "kalman"})
    random = np.random.default_rng(2)

    def show(z, thrust):
        command(process, thrust)
        position = (random.normal(0.0, 1e-3), random.normal(0.0, 1e-3), random.normal(z, 1e-3))
        fly(process, lambda _: (position, STILL), PERIOD)

    fly(process, lambda _: (STILL, STILL), 0.5)
    rate = math.pi / 2.0
    for tick in range(200):
        swing = math.cos(rate * tick * PERIOD)
        show(0.5 * (1.0 - swing), 9.81 + 0.5 * rate * rate * swing)
    for _ in range(200):
        show(1.0, 9.81)
    assert abs(process.published("/state")[-1].state.z_dot) < 0.05
    for _ in range(200):
        show(1.0, 12.0)
    last = process.published("/state")[-1]
    assert last.header.stamp.to_sec() < process.clock.stamp().to_sec() - 1.0
    assert last.state.z_dot > 0.4
    assert last.state.z > 1.05


@pytest.mark.parametrize("filter_type", ["finite_difference", "kalman"])
@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_a_camera_that_freezes_between_two_estimates_leaves_the_right_speed(filter_type, share):
    """The last pose was older than its stamp: the speed was half of the vehicle's."""
    process = launch(**{"topics/control": "/control/final", "filter/type": filter_type})
    fly(process, lambda _: (STILL, STILL), 0.5)

    def show(elapsed):
        command(process, 12.81)
        fly(process, lambda _: ((0.0, 0.0, 1.5 * elapsed**2), STILL), PERIOD)

    for tick in range(50):
        show(tick * PERIOD)
    for _ in range(5):
        show((49 + share) * PERIOD)
    last = process.published("/state")[-1]
    elapsed = last.header.stamp.to_sec() - process.clock.stamp().to_sec() + 0.55
    assert elapsed == pytest.approx(0.51, abs=1e-6)
    assert last.state.z_dot == pytest.approx(3.0 * elapsed, abs=0.06)
    assert last.state.z == pytest.approx(1.5 * elapsed**2, abs=0.01)


def test_a_camera_that_goes_on_shows_the_vehicle_elsewhere_three_times_in_a_row():
    camera = Camera(0.001).lift()
    there, elsewhere = (0.0, 0.0, 1.0), (0.04, 0.0, 1.0)
    camera.show(there, STILL, 2.0)
    assert all(camera.show(there, (0.0, 0.0, 2.0), 2.0)[-50:])
    for position, count in ((elsewhere, 2), (there, 1), (elsewhere, 2)):
        assert all(camera.show(position, STILL, count * PERIOD))
    assert not any(camera.show(elsewhere, STILL, 3 * PERIOD))


@pytest.mark.parametrize("knows_control", [True, False])
def test_the_ground_is_the_lowest_place_only_where_controls_are_not_known(knows_control):
    camera = Camera(knows_control=knows_control)
    camera.show((0.0, 0.0, 1.0), None, 0.1)
    camera.show((0.0, 0.0, 0.95), STILL, 0.1)
    assert all(camera.show((0.0, 0.0, 0.98), STILL, 0.1)[1:]) != knows_control


def test_a_vehicle_that_is_lifted_for_long_is_not_on_the_ground():
    camera = Camera()
    camera.time = 100.0
    camera.show((0.0, 0.0, 0.0), None, 1.0)
    # Beyond 3 m/s^2 for 2.5 s it has made 0.25 m/s; 0.3 m/s lift any vehicle.
    assert not any(camera.show((0.0, 0.0, 0.0), (0.0, 0.0, 3.1), 2.5))
    assert camera.show((0.0, 0.0, 0.0), (0.0, 0.0, 3.1), 1.0)[-1]
    # With the next takeoff it restarts.
    camera.show((0.0, 0.0, 0.001), None)
    assert not any(camera.show((0.0, 0.0, 0.001), (0.0, 0.0, 3.1), 2.5))
