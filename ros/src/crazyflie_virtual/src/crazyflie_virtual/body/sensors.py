"""Inertial sensors, barometer and magnetometer."""

import math
import random

from crazyflie_model.angles import Quaternion, Triple, rotate_back
from crazyflie_model.units import GRAVITY

#: Standard deviation of a sample, deg/s: the BMI088's noise density, 0.014 deg/s/sqrt(Hz) [data
#: sheet], in the firmware's bandwidth of about 50 Hz.
_GYRO_NOISE = 0.1

#: Standard deviation of a sample, g: 190 ug/sqrt(Hz) [data sheet] in about 100 Hz.
_ACCELEROMETER_NOISE = 0.002
_BAROMETER_NOISE = 0.05  #: Standard deviation of the height, m.
_ACCELEROMETER_RANGE = 24.0  #: g.
_GYRO_RANGE = 2000.0  #: deg/s.
#: Magnetic field, gauss, fixed frame: central Europe, with x to the north.
_FIELD = (0.2, 0.0, -0.43)
_SEA_LEVEL_PRESSURE = 1013.25  #: mbar.

_NOISE_SAMPLES = 8191


class Sensors:
    """What the vehicle measures of itself, with noise or without; ``seed`` is the noise's."""

    def __init__(self, noise: bool = True, seed: int = 0):
        source = random.Random(seed)
        # Drawing six numbers 500 times a second would cost more than the
        # controllers; a prime number of samples does not repeat in step.
        self._noise = [source.gauss(0.0, 1.0) if noise else 0.0 for _ in range(_NOISE_SAMPLES)]
        self._next = 0
        self.gyro_x = self.gyro_y = self.gyro_z = 0.0  #: deg/s, body frame (forward-left-up).
        self.acc_x, self.acc_y, self.acc_z = 0.0, 0.0, 1.0  #: g, body frame; (0, 0, 1) at rest.
        self.mag_x, self.mag_y, self.mag_z = _FIELD  #: gauss, body frame.
        #: asl, pressure, temperature: Height above sea level in m, mbar, degrees Celsius.
        self.asl = 0.0
        self.pressure = _SEA_LEVEL_PRESSURE
        self.temperature = 25.0

    def sample_inertial(self, rates: Triple, specific_force: Triple) -> None:
        """Measure body rates, rad/s, and acceleration without gravity's, m/s^2, body frame."""
        start = self._next
        self._next = start + 6 if start + 12 <= _NOISE_SAMPLES else (start + 6) % 7
        n = self._noise[start : start + 6]
        self.gyro_x = _clip(math.degrees(rates[0]) + _GYRO_NOISE * n[0], _GYRO_RANGE)
        self.gyro_y = _clip(math.degrees(rates[1]) + _GYRO_NOISE * n[1], _GYRO_RANGE)
        self.gyro_z = _clip(math.degrees(rates[2]) + _GYRO_NOISE * n[2], _GYRO_RANGE)
        limit, sigma = _ACCELEROMETER_RANGE, _ACCELEROMETER_NOISE
        self.acc_x = _clip(specific_force[0] / GRAVITY + sigma * n[3], limit)
        self.acc_y = _clip(specific_force[1] / GRAVITY + sigma * n[4], limit)
        self.acc_z = _clip(specific_force[2] / GRAVITY + sigma * n[5], limit)

    def sample_slow(self, height: float, quaternion: Quaternion) -> None:
        """Measure pressure and magnetic field at a height (m) and an attitude (x, y, z, w)."""
        self.mag_x, self.mag_y, self.mag_z = rotate_back(quaternion, _FIELD)
        self.asl = height + _BAROMETER_NOISE * self._noise[self._next]
        # International standard atmosphere.
        self.pressure = _SEA_LEVEL_PRESSURE * (1.0 - 2.25577e-5 * self.asl) ** 5.25588


def _clip(value, limit):
    return -limit if value < -limit else limit if value > limit else value
