"""Healthy flights of the full vehicle are believed; those that a frozen camera shows are not."""

import math
from pathlib import Path
from random import Random

import pytest
from rospkg import RosPack

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.limits import MAX_SPEED
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import GRAVITY
from crazyflie_simulator.vehicle import MotionCapture, SimulatedVehicle
from crazyflie_simulator.wind import Wind
from crazyflie_state_estimator.control_response import ControlInput
from crazyflie_state_estimator.motion import (
    ConstantAccelerationFilter,
    FiniteDifference,
    MotionEstimator,
)
from crazyflie_state_estimator.pose_monitor import PoseMonitor, Verdict

PERIOD = 0.01
LIFT_OFF, CLIMB = 0.3, 1.0
"""When the open loop of the takeoff begins, and when the controller takes over, s."""

CONFIG = Path(RosPack().get_path("crazyflie_lqr"), "config")
CONTROLLERS = {
    "lqr": ("K_quadrotor.txt", (-0.1, 0.1, -4.0), (0.5, 0.5, 0.7)),
    "soft": ("K_soft.txt", (-0.05, 0.05, -0.5), (1.0, 1.0, 6.0)),
    "without integrator": ("K_quadrotor.txt", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
}


class Flight:
    """A takeoff and a flight from goal to goal; the camera may freeze."""

    def __init__(self, seed, controller, has_kalman=True, camera=None, **vehicle):
        gains, k, limit = CONTROLLERS[controller]
        self.random = Random(seed)
        self.controller = IntegralStateFeedback(
            load_matrix(str(CONFIG / gains), 4, 7), (0.0, 0.0, 0.0, GRAVITY), 6, k, limit
        )
        self.controller.take_off()
        self.vehicle = SimulatedVehicle(StabilizedQuadrotor(**vehicle), (0.0, 0.0, 0.0), 0.0)
        self.camera = camera or MotionCapture(0.001, 0.005, seed=seed)
        filters = [FiniteDifference(PERIOD / 2.0) for _ in range(2)]
        if has_kalman:
            filters = [ConstantAccelerationFilter(1e-3, 1.0), ConstantAccelerationFilter(5e-3, 30)]
        self.estimator = MotionEstimator(*filters)
        self.control = ControlInput()
        self.monitor = PoseMonitor(MAX_SPEED, knows_control=True)
        self.goal = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
        self.next_goal = 6.0
        self.rejected_at = None

    def fly(self, duration, freeze=math.inf, from_goal_to_goal=True):
        """Fly until a pose is rejected, or the end; return the distance from the frozen pose."""
        frozen = None
        for count in range(round(duration / PERIOD)):
            time = count * PERIOD
            self.vehicle.advance_to(time)
            if time < freeze:
                frozen = self.vehicle.pose
            if from_goal_to_goal and time >= self.next_goal:
                self._choose_goal(time)
            self.camera.measure(time, *(self.vehicle.pose if time < freeze else frozen))
            for stamp, position, quaternion in self.camera.arrivals(time):
                if self._is_rejected(time, stamp, position, quaternion):
                    self.rejected_at = time
                    return math.dist(self.vehicle.pose[0], frozen[0])
        return math.dist(self.vehicle.pose[0], frozen[0])

    def _choose_goal(self, time):
        uniform = self.random.uniform
        self.goal[:3] = uniform(-1.5, 1.5), uniform(-1.5, 1.5), uniform(0.4, 2.0)
        self.next_goal = time + uniform(1.5, 8.0)

    def _is_rejected(self, time, stamp, position, quaternion):
        attitude = rpy_from_quaternion(*quaternion)
        acceleration = self.control.acceleration(attitude[2], time)
        verdict = self.monitor.update(stamp, position, quaternion, acceleration)
        if verdict is not Verdict.GOOD:
            return True
        motion = self.estimator.update(round(stamp * 1e9), position, attitude, acceleration)
        if time < CLIMB or motion is None:
            u = [0.0, 0.0, 0.0, GRAVITY + 0.2 if time > LIFT_OFF else 0.0]
        else:
            x = [*motion.position, *motion.velocity, attitude[2]]
            u = self.controller.control(x, self.goal, stamp)
        self.vehicle.command(u)
        self.control.command(u, time)
        return False


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(4, 16))]
)
def test_a_healthy_flight_is_believed(seed):
    random = Random(1000 + seed)
    uniform, choice = random.uniform, random.choice
    noise = choice([0.0, 2e-4, 1e-3, 3e-3])
    wind = Wind(
        (uniform(-2.0, 2.0), uniform(-2.0, 2.0), uniform(-0.3, 0.3)),
        choice([0.0, 0.2, 0.5, 1.0]),
        seed=seed,
    )
    flight = Flight(
        seed,
        choice(list(CONTROLLERS)),
        choice([True, True, False]),
        MotionCapture(noise, 5.0 * noise, choice([0.0, 0.02, 0.05]), choice([0.0, 0.1]), seed),
        mass_error=uniform(-0.1, 0.1),
        thrust_error=uniform(-0.1, 0.1),
        wind=wind.velocity,
    )
    flight.fly(20.0)
    assert flight.rejected_at is None


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_camera_that_freezes_is_noticed_with_the_next_pose_but_one(controller):
    for freeze in (2.5, 4.0, 6.25):
        flight = Flight(3, controller, camera=MotionCapture(), mass_error=0.05, thrust_error=-0.03)
        away = flight.fly(freeze + 10.0, freeze)
        assert flight.rejected_at - freeze < 1.5 * PERIOD
        assert away < 0.05


@pytest.mark.parametrize(
    ("controller", "freeze", "limit"),
    [
        ("lqr", 1.6, 2.0),
        ("lqr", 2.5, 1.0),
        ("lqr", 6.5, 1.0),
        ("soft", 2.5, 1.0),
        ("soft", 6.5, 0.5),
        ("without integrator", 6.5, 1.0),
    ],
)
def test_a_camera_that_freezes_and_is_noisy_is_noticed(controller, freeze, limit):
    flight = Flight(3, controller, mass_error=0.05, thrust_error=-0.03)
    away = flight.fly(freeze + 10.0, freeze)
    assert flight.rejected_at is not None
    assert flight.rejected_at > freeze
    assert away < limit


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_frozen_flight_is_handed_over_with_the_motion_of_the_vehicle(controller):
    flight = Flight(3, controller, mass_error=0.05, thrust_error=-0.03)
    away = flight.fly(12.5, 2.5)
    true = flight.vehicle.state
    position, velocity = flight.monitor.departure
    assert math.dist(position, true[:3]) < 0.5 * max(away, 0.2)
    assert math.dist(velocity, true[3:6]) < 0.6 * math.hypot(*true[3:6])
