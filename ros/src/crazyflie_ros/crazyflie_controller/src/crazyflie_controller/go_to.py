"""From where a vehicle is and where it should be to the setpoint that takes it there."""

from typing import NamedTuple

from crazyflie_controller.pid import PidParameters, SaturatedPid
from crazyflie_model.angles import rotate_by_yaw, wrap_to_pi

AXES = ("X", "Y", "Z", "Yaw")  #: Names of the four controllers.


class Pose(NamedTuple):
    """Position, m, and heading, rad, in the world frame."""

    x: float
    y: float
    z: float
    yaw: float


class Setpoint(NamedTuple):
    """What cmd_vel carries.

    Pitch (deg, positive accelerates ahead) is ``linear.x``, roll (deg, positive accelerates to the
    right) ``linear.y``, thrust (PWM) ``linear.z``, yaw rate (deg/s, clockwise) ``angular.z``.
    """

    pitch: float = 0.0
    roll: float = 0.0
    thrust: float = 0.0
    yaw_rate: float = 0.0


class GoToController:
    """Four PID controllers on the error in the vehicle's heading frame (ahead, to the left, up).

    The tilt is left out on purpose: to a vehicle that leans ahead, a goal far below would seem to
    lie ahead, and make it lean even more. Parameters are by `AXES`; outputs are pitch, roll, thrust
    and yaw rate of `Setpoint`, from errors in m and rad.
    """

    def __init__(self, parameters: dict[str, PidParameters]):
        self._pids = [SaturatedPid(parameters[axis]) for axis in AXES]
        self._error: list[float] | None = None

    @property
    def max_thrust(self) -> float:
        """Largest thrust that the controller sets, PWM."""
        return self._pids[2].parameters.max_output

    def reconfigure(self, parameters: dict[str, PidParameters]) -> None:
        """Set gains and limits; the integrals' parts in the setpoint stay.

        They change as little as the new limits allow, and vanish where ki is 0.
        """
        for axis, pid in zip(AXES, self._pids, strict=True):
            pid.parameters = parameters[axis]

    def reset(self, thrust: float) -> None:
        """Set all integrals to zero but that of Z, which gives ``thrust`` (PWM)."""
        for pid, output in zip(self._pids, (0.0, 0.0, thrust, 0.0), strict=True):
            pid.reset(output)
        self.restart_derivatives()

    def restart_derivatives(self) -> None:
        """Compute no rate of change with the next error, which does not continue the last one."""
        self._error = None

    def update(self, pose: Pose, goal: Pose, interval: float) -> Setpoint:
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
        return Setpoint(*(pid.update(e, rate, interval) for pid, e, rate in columns))


def _in_heading_frame(error, yaw):
    # The slope is computed before the rotation, so that a turn of the vehicle does not look
    # like a motion of the goal.
    return [*rotate_by_yaw(error[0], error[1], -yaw), *error[2:]]
