"""A simulated vehicle that is flown by cmd_vel."""

import math
from pathlib import Path

import numpy as np
import yaml

from crazyflie_controller.flight import GoToFlight
from crazyflie_controller.go_to import GoToController, HeadingPose, PidParameters
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.stabilized_quadrotor import StabilizedQuadrotor
from crazyflie_model.units import thrust_from_pwm
from crazyflie_simulator.vehicle import SimulatedVehicle

PERIOD = 0.02
"""Of the controller, s."""

CONFIG = Path(__file__).parents[1] / "config" / "crazyflie2.yaml"


def parameters():
    """Return the gains of the configuration file as private parameters of a node."""
    pids = _configured()
    return {f"PIDs/{axis}/{key}": value for axis in pids for key, value in pids[axis].items()}


def pids():
    """Return the gains of the configuration file, by axis."""
    return {axis: PidParameters.from_mapping(values) for axis, values in _configured().items()}


def _configured():
    return yaml.safe_load(CONFIG.read_text())["PIDs"]


def control_from_cmd_vel(pitch, roll, thrust, yaw_rate):
    """Return the simulator's control (roll, pitch, yaw rate, thrust) of a cmd_vel.

    Angles in deg, yaw rate in deg/s clockwise, thrust in PWM.
    """
    return [
        math.radians(roll),
        math.radians(pitch),
        -math.radians(yaw_rate),
        thrust_from_pwm(thrust),
    ]


class Loop:
    """A flight of a simulated vehicle, tick by tick.

    Parameters
    ----------
    ground : float
        Height of the ground in the world frame, m.
    pose_period : float
        Time between two poses that are seen, s.
    errors
        See `StabilizedQuadrotor`.
    """

    def __init__(self, ground=0.0, pose_period=PERIOD, **errors):
        self._errors = errors
        self._ground = ground
        self.flight = GoToFlight(GoToController(pids()))
        self.is_seen = True
        self.track, self.setpoints = [], []
        self._count = 0
        self._pose_period = pose_period
        self._seen = (None, None)
        self.put(0.0, 0.0)

    @property
    def time(self):
        return self._count * PERIOD

    def put(self, x, y):
        """Stand the vehicle somewhere on the ground, switched on again."""
        self._vehicle = SimulatedVehicle(
            StabilizedQuadrotor(**self._errors), (x, y, 0.0), self.time
        )

    def pose(self):
        (x, y, z), quaternion = self._vehicle.pose
        return HeadingPose(
            float(x), float(y), float(z) + self._ground, rpy_from_quaternion(*quaternion)[2]
        )

    def run(self, duration):
        """Fly on and return the poses meanwhile, shape (ticks, 4)."""
        begin = len(self.track)
        for _ in range(round(duration / PERIOD)):
            self._tick()
        return np.array(self.track[begin:])

    def run_until(self, is_done, limit):
        """Fly on until ``is_done()``, at most ``limit`` (s); return the poses meanwhile."""
        begin, end = len(self.track), self.time + limit
        while not is_done():
            assert self.time < end, f"not done after {limit} s: {self.flight.state}, {self.pose()}"
            self._tick()
        return np.array(self.track[begin:])

    def _tick(self):
        self._vehicle.advance_to(self.time)
        if self.is_seen:
            stamp = math.floor(self.time / self._pose_period + 1e-6) * self._pose_period
            if self._seen[0] is None or stamp > self._seen[0]:
                self._seen = (stamp, self.pose())
        setpoint = self.flight.tick(self.time, *self._seen)
        if setpoint is not None:
            self._vehicle.command(
                control_from_cmd_vel(
                    setpoint.pitch, setpoint.roll, setpoint.thrust, setpoint.yaw_rate
                )
            )
        self.track.append(self.pose())
        self.setpoints.append(setpoint)
        self._count += 1
