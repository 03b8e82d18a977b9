"""Attitude and rate controllers, 500 Hz.

A cascade: errors of the attitude set body rates, errors of the rates set what
the mixer adds to and takes from the thrust of the motors. The gains are those of
`crazyflie_model.inner_loops`, which has the loops without the firmware's
modes, parameters and log variables.
"""

from math import isnan

from crazyflie_model.angles import Triple
from crazyflie_model.inner_loops import HEADING, HEADING_RATE, OUTPUT_LIMIT, PERIOD, TILT, TILT_RATE
from crazyflie_virtual.firmware.pid import FirmwarePid, constrain
from crazyflie_virtual.firmware.states import Estimate


def wrap_degrees(angle: float) -> float:
    """Return the angle in [-180, 180) that points the same way, deg."""
    return (angle + 180.0) % 360.0 - 180.0


class AttitudeController:
    """From desired attitude or rates to the outputs about the three axes."""

    def __init__(self) -> None:
        self.roll = FirmwarePid(TILT, PERIOD)  #: roll, pitch, yaw: deg to deg/s.
        self.pitch = FirmwarePid(TILT, PERIOD)
        self.yaw = FirmwarePid(HEADING, PERIOD)
        #: roll_rate, pitch_rate, yaw_rate: deg/s to PWM.
        self.roll_rate = FirmwarePid(TILT_RATE, PERIOD)
        self.pitch_rate = FirmwarePid(TILT_RATE, PERIOD)
        self.yaw_rate = FirmwarePid(HEADING_RATE, PERIOD)
        #: How far the desired heading may run ahead of the vehicle's, deg; 0 for no limit.
        self.yaw_max_delta = 0.0

    def reset(self) -> None:
        """Forget integrals and last measurements."""
        rates = (self.roll_rate, self.pitch_rate, self.yaw_rate)
        for pid in (self.roll, self.pitch, self.yaw, *rates):
            pid.reset()

    def desired_rates(self, estimate: Estimate, roll: float, pitch: float, yaw: float) -> Triple:
        """Return the body rates (deg/s) that lead to an attitude (deg)."""
        yaw_error = wrap_degrees(yaw - estimate.yaw)
        return (
            self.roll.update(roll, estimate.roll),
            self.pitch.update(pitch, estimate.pitch),
            # What is measured is taken next to what is desired, or the
            # derivative would jump where the heading wraps.
            self.yaw.update(yaw, yaw - yaw_error, yaw_error),
        )

    def outputs(self, rates: Triple, gyro: Triple) -> Triple:
        """Return the outputs about roll, pitch and yaw that lead to body rates, PWM.

        Rates desired and measured (``gyro``) are in deg/s, pitch in the firmware's sign.
        """
        return (
            _to_16_bits(self.roll_rate.update(rates[0], gyro[0])),
            _to_16_bits(self.pitch_rate.update(rates[1], gyro[1])),
            _to_16_bits(self.yaw_rate.update(rates[2], gyro[2])),
        )


def _to_16_bits(output):
    # NaN becomes 0, as an x86 converts it.
    return 0.0 if isnan(output) else constrain(output, -OUTPUT_LIMIT, OUTPUT_LIMIT)
