"""PID controllers from a vehicle's pose and its goal to a setpoint."""

from typing import NamedTuple

from crazyflie_model.angles import rotate_by_yaw, wrap_to_pi
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import Number

INTEGRATED_ERROR = 0.2
"""Largest error that is integrated, m or rad.

It limits the overshoot at a goal far away. With the gains of Z in config/crazyflie2.yaml a step
of 1 m overshoots by 0.6 m without this limit and by 0.3 m with it; errors below it are not
affected."""

_INTEGRAL = Number("m s or rad s")


class PidParameters(Parameters):
    """Gains and limits of a `SaturatedPid`."""

    kp: float = parameter(Number("output per m or rad"), "gain of the error", live=True)
    kd: float = parameter(
        Number("output per m/s or rad/s"), "gain of the error's rate of change", live=True
    )
    ki: float = parameter(
        Number("output per m s or rad s"), "gain of the error's integral", live=True
    )
    min_output: float = parameter(
        Number("output"), "least output, at most maxOutput", name="minOutput", live=True
    )
    max_output: float = parameter(Number("output"), "largest output", name="maxOutput", live=True)
    integrator_min: float = parameter(
        _INTEGRAL,
        "least integral of the error, at most integratorMax",
        name="integratorMin",
        live=True,
    )
    integrator_max: float = parameter(
        _INTEGRAL, "largest integral of the error", name="integratorMax", live=True
    )


class SaturatedPid:
    """output = kp error + kd slope + ki integral, within limits.

    The integral itself, not its part in the output, is limited against windup; see also
    `INTEGRATED_ERROR`.
    """

    def __init__(self, parameters: PidParameters):
        self._parameters = parameters
        self._integral = 0.0

    @property
    def parameters(self) -> PidParameters:
        """Gains and limits."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: PidParameters) -> None:
        # The integral of Z carries the vehicle's weight: its part in the output must be kept.
        output = self._parameters.ki * self._integral
        self._parameters = parameters
        self.reset(output)

    def reset(self, output: float = 0.0) -> None:
        """Set the integral that gives ``output`` without an error, within its limits.

        Without an integral gain it is zero.
        """
        self._integral = 0.0
        if self._parameters.ki != 0.0:
            self._integrate(output / self._parameters.ki)

    def update(self, error: float, slope: float, interval: float) -> float:
        """Return the output for an error (goal minus measurement) and its slope (per s).

        The interval is the time since the last update, s, >= 0.
        """
        gains = self._parameters
        integrated = min(max(error, -INTEGRATED_ERROR), INTEGRATED_ERROR)
        self._integrate(self._integral + integrated * interval)
        output = gains.kp * error + gains.kd * slope + gains.ki * self._integral
        return min(max(output, gains.min_output), gains.max_output)

    def _integrate(self, integral):
        limits = self._parameters
        self._integral = min(max(integral, limits.integrator_min), limits.integrator_max)


AXES = ("X", "Y", "Z", "Yaw")  #: Names of the four controllers.


class HeadingPose(NamedTuple):
    """Position, m, and heading, rad, in the world frame."""

    x: float
    y: float
    z: float
    yaw: float


class GoToSetpoint(NamedTuple):
    """A setpoint on cmd_vel.

    Pitch (deg, positive accelerates ahead) is ``linear.x``, roll (deg, positive accelerates to the
    right) ``linear.y``, thrust (PWM) ``linear.z``, yaw rate (deg/s, clockwise) ``angular.z``.
    """

    pitch: float = 0.0
    roll: float = 0.0
    thrust: float = 0.0
    yaw_rate: float = 0.0


class GoToController:
    """Four PID controllers on the error in the vehicle's heading frame (ahead, to the left, up).

    The tilt is ignored on purpose: for a vehicle that is tilted forward, a goal far below would
    seem to be ahead, and tilt it even more. Parameters are by `AXES`; outputs are pitch, roll,
    thrust and yaw rate of `GoToSetpoint`, from errors in m and rad.
    """

    def __init__(self, parameters: dict[str, PidParameters]):
        self._pids = [SaturatedPid(parameters[axis]) for axis in AXES]
        self._error: list[float] | None = None

    @property
    def max_thrust(self) -> float:
        """Largest thrust that the controller sets, PWM."""
        return self._pids[2].parameters.max_output

    def reconfigure(self, parameters: dict[str, PidParameters]) -> None:
        """Set gains and limits; the integrals' parts in the setpoint are kept.

        They change as little as the new limits allow, and vanish where ki is 0.
        """
        for axis, pid in zip(AXES, self._pids, strict=True):
            pid.parameters = parameters[axis]

    def reset(self, thrust: float) -> None:
        """Set all integrals to zero except that of Z, which gives ``thrust`` (PWM)."""
        for pid, output in zip(self._pids, (0.0, 0.0, thrust, 0.0), strict=True):
            pid.reset(output)
        self.restart_derivatives()

    def restart_derivatives(self) -> None:
        """Skip the rate of change at the next error, which does not continue the last one."""
        self._error = None

    def update(self, pose: HeadingPose, goal: HeadingPose, interval: float) -> GoToSetpoint:
        """Return the setpoint.

        The interval is the time between the last pose and this one, s; > 0 except after
        `restart_derivatives`.
        """
        error = [*(g - p for g, p in zip(goal[:3], pose[:3], strict=True))]
        error.append(wrap_to_pi(goal.yaw - pose.yaw))
        slope = [0.0] * 4
        if self._error is None:
            interval = 0.0
        else:
            change = [e - last for e, last in zip(error, self._error, strict=True)]
            change[3] = wrap_to_pi(change[3])
            slope = [c / interval for c in change]
        self._error = error
        errors, slopes = _in_heading_frame(error, pose.yaw), _in_heading_frame(slope, pose.yaw)
        columns = zip(self._pids, errors, slopes, strict=True)
        return GoToSetpoint(*(pid.update(e, rate, interval) for pid, e, rate in columns))


def _in_heading_frame(error, yaw):
    # The slope is computed before the rotation, so that a turn of the vehicle does not look
    # like a motion of the goal.
    return [*rotate_by_yaw(error[0], error[1], -yaw), *error[2:]]
