"""Attitude and rate controllers, 500 Hz.

A cascade: errors of the attitude set body rates, errors of the rates set what
the mixer adds to and takes from the thrust of the motors. Structure and gains
are those of the Crazyflie 2.1's firmware (2024, controller PID).
"""

from crazyflie_virtual.firmware.pid import Pid

DT = 0.002
"""Time between two updates, s."""

_LARGEST = 32767.0
"""The outputs are 16 bits wide in the firmware, PWM."""


def wrap_degrees(angle: float) -> float:
    """Return the angle in [-180, 180) that points the same way, deg."""
    return (angle + 180.0) % 360.0 - 180.0


class AttitudeController:
    """From desired attitude or rates to the outputs about the three axes.

    Attributes
    ----------
    roll, pitch, yaw : Pid
        deg to deg/s.
    roll_rate, pitch_rate, yaw_rate : Pid
        deg/s to PWM.
    yaw_max_delta : float
        How far the desired heading may run ahead of the vehicle's, deg; 0 for
        no limit.
    """

    def __init__(self):
        self.roll = Pid(6.0, 3.0, 0.0, DT, integral_limit=20.0)
        self.pitch = Pid(6.0, 3.0, 0.0, DT, integral_limit=20.0)
        self.yaw = Pid(6.0, 1.0, 0.35, DT, integral_limit=360.0)
        self.roll_rate = Pid(250.0, 500.0, 2.5, DT, integral_limit=33.3, output_limit=_LARGEST)
        self.pitch_rate = Pid(250.0, 500.0, 2.5, DT, integral_limit=33.3, output_limit=_LARGEST)
        self.yaw_rate = Pid(120.0, 16.7, 0.0, DT, integral_limit=166.7, output_limit=_LARGEST)
        self.yaw_max_delta = 0.0

    def reset(self) -> None:
        """Begin anew."""
        for pid in (self.roll, self.pitch, self.yaw):
            pid.reset()
        for pid in (self.roll_rate, self.pitch_rate, self.yaw_rate):
            pid.reset()

    def desired_rates(self, estimate, roll: float, pitch: float, yaw: float) -> tuple:
        """Return the body rates (deg/s) that lead to an attitude (deg)."""
        yaw_error = wrap_degrees(yaw - estimate.yaw)
        return (
            self.roll.update(roll, estimate.roll),
            self.pitch.update(pitch, estimate.pitch),
            # What is measured is taken next to what is desired, or the
            # derivative would jump where the heading wraps.
            self.yaw.update(yaw, yaw - yaw_error, yaw_error),
        )

    def outputs(self, rates: tuple, gyro: tuple) -> tuple:
        """Return the outputs about roll, pitch and yaw that lead to body rates.

        Parameters
        ----------
        rates, gyro : tuple, 3 components
            Desired and measured, deg/s, pitch in the firmware's sign.

        Returns
        -------
        tuple of float
            PWM.
        """
        return (
            self.roll_rate.update(rates[0], gyro[0]),
            self.pitch_rate.update(rates[1], gyro[1]),
            self.yaw_rate.update(rates[2], gyro[2]),
        )
