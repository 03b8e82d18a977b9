"""Limits of a Crazyflie: of the hardware, of the firmware, and of commands."""

FULL_PWM = 65535.0  #: Largest command of a motor and of the radio link, 16 bits.

#: Largest thrust of an attitude setpoint (PWM): firmware and driver limit it to this, and leave
#: the rest to the attitude loops (MAX_THRUST of crtp_commander_rpyt.c).
MAX_SETPOINT_PWM = 60000.0

MAX_TILT = 0.2618  #: Largest roll and pitch that controllers ask for, rad (15 degrees).

#: Largest yaw rate of a control, rad/s (200 degrees/s), as in crazyflie_controller and in
#: teleoperation.
MAX_YAW_RATE = 3.4907

#: Tilt beyond which a vehicle has crashed or is about to, rad (60 degrees).
CRASH_TILT = 1.0472

#: Range of the thrust that controllers ask for in flight (m/s^2): with less a vehicle is on the
#: ground or has its motors off, and it cannot produce more.
MIN_THRUST, MAX_THRUST = 4.0, 16.0

MAX_SPEED = 5.0  #: Largest plausible speed of a vehicle (m/s).

#: Age of the last setpoint from which the firmware levels a flying vehicle out, and from which it
#: stops its motors, s (COMMANDER_WDT_TIMEOUT_STABILIZE and _SHUTDOWN of commander.h).
LEVEL_AGE, OFF_AGE = 0.5, 2.0

#: Longest time for which a valid value replaces invalid ones (s): the firmware, too, gives up a
#: setpoint then.
HOLD_LIMIT = LEVEL_AGE
