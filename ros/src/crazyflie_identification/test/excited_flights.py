"""Excited flights, for tests, of simulated vehicles and of the virtual firmware."""

import dataclasses
import math
import struct
import tempfile
from pathlib import Path

import numpy as np

from crazyflie_identification import excitation
from crazyflie_identification.fit import Recording
from crazyflie_lqr.linear_feedback import IntegralStateFeedback, limited
from crazyflie_model.angles import zyx_from_quaternion
from crazyflie_model.first_order_quadrotor import FirstOrderQuadrotor
from crazyflie_model.quadrotor import TYPES
from crazyflie_simulator.vehicle import MotionCapture, SimulatedVehicle
from crazyflie_utils.parameters import model_file
from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle

KIND = TYPES["cf21_markers"]
PERIOD = 0.01  #: Period of poses and controls (s).
HEIGHT = 4.0  #: A vehicle that is heavier than it is taken for sinks at first, m.
SETTLING = 8.0  #: Time until the integrator has found its weight, s.


def drawn(seed):
    """Return a vehicle at random: mass, delay, lags, drag, trims."""
    random = np.random.default_rng(seed)
    scale = float(random.uniform(0.5, 2.0))
    lags = random.uniform(0.03, 0.12, 3).tolist()
    trims = np.radians(random.uniform(-2.0, 2.0, 2)).tolist()
    return dataclasses.replace(
        KIND,
        mass=float(random.uniform(0.027, 0.045)),
        # Whole steps of the virtual firmware.
        delay=0.002 * round(random.uniform(0.0, 30.0)),
        roll_lag=lags[0],
        pitch_lag=lags[1],
        yaw_lag=lags[2],
        drag_horizontal=scale * KIND.drag_horizontal,
        drag_vertical=scale * KIND.drag_vertical,
        roll_trim=trims[0],
        pitch_trim=trims[1],
    )


class Simulated:
    """A vehicle of the simulator."""

    def __init__(self, true):
        dynamics = FirstOrderQuadrotor(true)
        vehicle = SimulatedVehicle(dynamics, (0.0, 0.0, HEIGHT), 0.0, delay=true.delay)
        self._true, self._vehicle, self.advance_to = true, vehicle, vehicle.advance_to

    @property
    def pose(self):
        """Position in m, and quaternion."""
        return self._vehicle.pose

    def send(self, roll, pitch, yaw_dot, pwm):
        """Command an attitude (rad, rad/s) and a thrust (PWM)."""
        true = self._true
        u = (roll - true.roll_trim, pitch - true.pitch_trim, yaw_dot, true.thrust(pwm))
        self._vehicle.command(u)


class Virtual:
    """A virtual vehicle, with its firmware, that is flown by packets."""

    def __init__(self, true):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "true.yaml"
            model_file.save(path, "cf21_markers", true, {})
            self._turn_on(model=str(path))

    @classmethod
    def of_type(cls, name, _, mass_error, thrust_error):
        """Return a vehicle of a type with errors, as fractions."""
        made = cls.__new__(cls)
        made._turn_on(model=name, mass_error=mass_error, thrust_error=thrust_error)
        return made

    def _turn_on(self, **settings):
        settings = {"positioning": "none", "observer/port": 0, **settings}
        self._vehicle = VirtualVehicle(VehicleSettings.from_mapping(settings))
        self._start = 0.2
        self.advance_to(0.0)
        # Opens the lock of the thrust.
        self.send(0.0, 0.0, 0.0, 0)

    def advance_to(self, time):
        """Fly until a time, s."""
        self._vehicle.advance_to(self._start + time)

    @property
    def pose(self):
        """Position in m, and quaternion."""
        return self._vehicle.physics.position, self._vehicle.physics.quaternion

    @property
    def velocity(self):
        """m/s."""
        return self._vehicle.physics.velocity

    def send(self, roll, pitch, yaw_dot, pwm):
        """Command an attitude (rad, rad/s) and a thrust (PWM), as the driver does."""
        degrees = np.degrees([roll, -pitch, -yaw_dot])
        data = struct.pack("<fffH", *degrees, round(pwm))
        assert self._vehicle.receive(Packet(Port.SETPOINT, 0, data).encode()) == []


def fly(true, feedback, flown=KIND, duration=40.0, path=None, seed=0, kind=Simulated):
    """Fly a vehicle of a kind; return the recording and the errors of position, m.

    ``feedback`` are gains, shape (4, 7), for the vehicle that it is taken for, ``flown``.

    ``path(t)`` returns displacement and velocity of the reference; without one it is excited.
    """
    vehicle = kind(true)
    mocap = MotionCapture(0.0002, 0.001, seed=seed)
    k = (-0.05, 0.05, -0.5)
    controller = IntegralStateFeedback(
        feedback, np.array([0.0, 0.0, 0.0, 9.81]), 6, k, (1.0, 1.0, 6.0)
    )
    controller.enable_integrator()
    times, commands, poses, errors = [], [], [], []
    last = None
    velocity = np.zeros(3)
    for step in range(round((SETTLING + duration) / PERIOD)):
        t = step * PERIOD
        vehicle.advance_to(t)
        mocap.measure(t, *vehicle.pose)
        ((_, position, quaternion),) = mocap.arrivals(t)
        rpy = zyx_from_quaternion(quaternion)
        if last is not None:
            # A low pass of 20 ms, as the Kalman filter of the estimator has it.
            velocity += (1.0 - math.exp(-0.5)) * ((np.array(position) - last) / PERIOD - velocity)
        last = np.array(position)
        since = t - SETTLING
        offset, speed = (path or excitation.reference)(max(since, 0.0))
        target = np.array([offset[0], offset[1], HEIGHT + offset[2], *speed, 0.0])
        state = np.array([*position, *velocity, rpy[2]])
        u = np.array(controller.control(state, target, t))
        if path is None:
            u = np.array(limited(list(u + np.array(excitation.controls(since)))))
        pwm = float(round(min(flown.pwm(float(u[3])), 60000.0)))
        sent = (u[0] + flown.roll_trim, u[1] + flown.pitch_trim, u[2], pwm)
        vehicle.send(*sent)
        if since < 0.0:
            continue
        times.append(t)
        commands.append(sent)
        poses.append([*position, *rpy])
        errors.append(np.linalg.norm(np.array(vehicle.pose[0]) - target[:3]))
    time = np.array(times)
    return Recording(time, np.array(commands), time, np.array(poses)), np.array(errors)
