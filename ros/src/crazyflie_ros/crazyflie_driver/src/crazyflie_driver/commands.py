"""High-level commands and their services, and flights by them as a vehicle reports them."""

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from crazyflie_driver import srv
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.positioning import ESTIMATOR, KALMAN
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.vehicle_base import BaseVehicle
from crazyflie_link.broadcast import SharedCommand
from crazyflie_link.errors import LinkLostError, NoReplyError
from crazyflie_link.high_level import ALL_GROUPS, HighLevel
from crazyflie_model.supervisor import SupervisorState

#: Commands that differ from the others, which move a vehicle in the air.
TAKEOFF, LAND, STOP = "takeoff", "land", "stop"


def _go_to(high_level, r, duration, linear=False):
    goal = (r.goal.x, r.goal.y, r.goal.z)
    high_level.go_to(goal, r.yaw, duration, r.relative, r.groupMask, linear)


def _spiral(high_level, r, duration):
    radii = (r.initialRadius, r.finalRadius)
    high_level.spiral(r.angle, radii, r.ascent, duration, r.sideways, r.clockwise, r.groupMask)


#: High-level command -> type of its service, and function that sends a request with a duration (s).
_COMMANDS: dict[str, tuple[Any, Callable[[HighLevel, Any, float], None]]] = {
    "takeoff": (srv.Takeoff, lambda h, r, duration: h.take_off(r.height, duration, r.groupMask)),
    "land": (srv.Land, lambda h, r, duration: h.land(r.height, duration, r.groupMask)),
    "stop": (srv.Stop, lambda h, r, _: h.stop(r.groupMask)),
    "go_to": (srv.GoTo, _go_to),
    "start_trajectory": (
        srv.StartTrajectory,
        lambda h, r, _: h.start_trajectory(
            r.trajectoryId, r.timescale, r.relative, r.reversed, r.groupMask
        ),
    ),
    "go_to_linear": (srv.GoTo, partial(_go_to, linear=True)),
    "spiral": (srv.Spiral, _spiral),
}

#: High-level command -> type of its service.
SERVICE_TYPES = {name: service_type for name, (service_type, _) in _COMMANDS.items()}


@dataclass(frozen=True)
class Command:
    """A high-level command: ``send(high_level)`` blocks until the vehicle has replied.

    The name is that of its service, the duration that of the motion, s. A landing has a height (m),
    unless it only goes on with the one under way.
    """

    name: str
    send: Callable[[HighLevel], None]
    duration: float = 0.0
    group_mask: int = ALL_GROUPS
    height: float | None = None

    def by(self, shared: SharedCommand | None) -> "Command":
        """Return the command, sent with those to other vehicles; with None the same command."""
        if shared is None:
            return self
        return replace(self, send=lambda high_level: self.send(high_level.broadcast(shared)))

    @property
    def ends_flight(self) -> bool:
        """Whether the vehicle is on the ground afterwards, and it goes before all others."""
        return self.name in (LAND, STOP)


def requested(name: str, request: Any) -> Command:
    """Return the command that a service with this name is asked for."""
    duration = request.duration.to_sec() if hasattr(request, "duration") else 0.0
    _, send = _COMMANDS[name]
    return Command(
        name,
        lambda high_level: send(high_level, request, duration),
        duration,
        request.groupMask,
        request.height if name == LAND else None,
    )


class Need(enum.Enum):
    """Packets that a vehicle needs for a command."""

    COMMAND = enum.auto()
    SETPOINTS_STOP = enum.auto()  #: The notice that setpoints stop, right before the command.
    #: No packet: a landing would start the motors of a vehicle on the ground.
    ON_GROUND = enum.auto()
    NOT_ADDRESSED = enum.auto()  #: No packet: the command is for other groups.


#: Largest age of a logged state, s: the firmware's supervisor runs at 25 Hz, its log at 10 Hz.
REPORT_LAG = 0.2
_LOGGED_STATE_LIMIT = 1.0  #: Time limit of log data with the state, s; they come every 0.1 s.


@dataclass(eq=False)
class CommandedFlight:
    """Distinguish flights by the high-level commander from other states with FLYING.

    FLYING holds until 2 s after the motors have stopped, and a landing that is commanded then
    starts them again: a flight needs HIGH_LEVEL_ACTIVE, too. For firmware that does not report it
    (before protocol 12), the last commands decide: when the planner was commanded to move, and when
    it keeps the motors off.
    """

    _vehicle: BaseVehicle
    _log: LogTopics
    _setpoints: SetpointTopics
    _planned: float = -math.inf
    _plan_end: float = math.inf

    def read(self) -> SupervisorState | None:
        """Return the state, from supervisor or log; None if neither reports it; blocks.

        Before protocol 12 the supervisor cannot be asked; very old firmware does not log it either.
        """
        try:
            state = self._vehicle.crazyflie.supervisor.read()
        except NoReplyError:
            state = None
        return self._log.next_state(_LOGGED_STATE_LIMIT) if state is None else state

    def estimator_problem(self) -> str:
        """Return why its positioning or Kalman filter is not ready; empty if unknown; blocks."""
        positioning = self._log.positioning
        if positioning is not None and (
            problem := positioning.problem(self._vehicle.handle.time())
        ):
            return problem
        try:
            estimator = self._vehicle.crazyflie.parameters.known(ESTIMATOR)
        except LinkLostError:
            return ""
        return self._log.variances_problem() if estimator == KALMAN else ""

    def motion_sent(self, moment: float) -> None:
        """Record that the planner was commanded to move, at a time (s)."""
        if moment > self._planned:
            self._planned, self._plan_end = moment, math.inf

    def end_accepted(self, duration: float) -> None:
        """Record that the planner stops the motors after a duration (s)."""
        self._plan_end = self._vehicle.handle.time() + duration

    def is_at_rest(self) -> bool:
        """Return whether the planner is known to have no motion that has not ended."""
        state = self._log.supervisor
        if state is None or not state.reports_planner:
            return False
        is_old = self._vehicle.handle.time() - self._planned >= REPORT_LAG
        return is_old and not self.is_moving(state)

    def is_moving(self, state: SupervisorState) -> bool:
        """Return whether a state shows a motion of the planner that has not ended."""
        if not state.reports_planner:
            return SupervisorState.FLYING in state
        is_active = SupervisorState.HIGH_LEVEL_ACTIVE in state
        return is_active and SupervisorState.TRAJECTORY_FINISHED not in state

    def has_taken_off(self, state: SupervisorState) -> bool:
        """Return whether a state shows a takeoff of the planner, also one that has ended."""
        is_reported = state.reports_planner
        return (
            SupervisorState.HIGH_LEVEL_ACTIVE if is_reported else SupervisorState.FLYING
        ) in state

    def is_high_level(self, state: SupervisorState | None) -> bool:
        """Return whether a state, None if unknown, is a flight by the high-level commander."""
        return state is not None and SupervisorState.FLYING in state and self._may_move(state)

    def is_on_ground(self) -> bool:
        """Return whether neither setpoints nor planner can have the motors run; blocks."""
        state = self.read()
        is_streamed = self._setpoints.runs_motors
        latest = max(self._planned, self._setpoints.last_time if is_streamed else -math.inf)
        if state is None or self._vehicle.handle.time() - latest < REPORT_LAG:
            return False
        return not (self._may_move(state) or (is_streamed and SupervisorState.FLYING in state))

    def _may_move(self, state):
        # Whether the planner may run the motors.
        if state.reports_planner:
            return SupervisorState.HIGH_LEVEL_ACTIVE in state
        is_latest = self._planned >= self._setpoints.last_time
        return is_latest and self._vehicle.handle.time() < self._plan_end
