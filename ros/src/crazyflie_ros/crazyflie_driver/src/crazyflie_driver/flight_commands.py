"""High-level commands to one vehicle, and what keeps them from dropping it."""

import contextlib
import enum
import time
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TypeVar

from crazyflie_driver.battery import Battery, Charge
from crazyflie_driver.command import LAND, STOP, TAKEOFF, Command
from crazyflie_driver.emergency import Emergency
from crazyflie_driver.flight_state import REPORT_LAG, FlightState
from crazyflie_driver.jobs import Job, Jobs
from crazyflie_driver.server_parameters import SafetyParameters
from crazyflie_driver.setpoint_gate import Event
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import (
    AlreadyLandingError,
    CrazyflieError,
    LinkLostError,
    NoReplyError,
)
from crazyflie_link.high_level import HighLevel
from crazyflie_link.supervisor import Supervisor
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.timers import Timer

Result = TypeVar("Result")

#: Time in which a notice that setpoints stop needs the command that it belongs to, s.
NOTIFY_WINDOW = 0.5
_WATCHDOG_PERIOD = 0.2  #: The firmware gives up after 1 s without being fed.

#: Time in which a vehicle arms itself, s. Firmware 2026.08 disarms and arms itself 3 s after a
#: landing (0.16 s) and every 30 s on the ground (0.08 s).
_REARMING = 0.5

#: How long a vehicle that has not answered a command is looked up before its caller is told, s; and
#: how often. It is heard again within 1 s, or gets a new link.
_LOOK_UP_LIMIT, _LOOK_UP_PERIOD = 1.5, 0.05


class Need(enum.Enum):
    """What a vehicle needs for a command."""

    COMMAND = enum.auto()
    SETPOINTS_STOP = enum.auto()  #: The notice that setpoints stop, right before the command.
    ON_GROUND = enum.auto()  #: Nothing: it is to land, and the command would start its motors.
    NOT_ADDRESSED = enum.auto()  #: Nothing: the command is for other groups.


@dataclass(eq=False)
class FlightCommands:
    """Send a vehicle high-level commands.

    In flight the firmware stops its motors at the notice that setpoints stop, unless a command
    follows at once: so the notice is sent together with the command, which was checked before.

    A command that has a vehicle move and is not answered is looked up: the vehicle's state decides
    whether it is a success. If the vehicle is not heard, it is a failure, and the vehicle is landed
    should it obey when it is heard again.
    """

    _handle: NodeHandle
    _name: str
    _crazyflie: Crazyflie
    _setpoints: SetpointTopics
    _flight: FlightState
    _battery: Battery
    _emergency: Emergency
    _jobs: Jobs
    _safety: SafetyParameters
    # How long the last setpoint shall count, ms, in a notice that has not been sent yet.
    _pending_notify: int | None = None
    _notify_timer: Timer | None = None
    _feeds_watchdog: bool = False
    refusal: str = ""  #: Why the vehicle is given no command that moves it; empty if it is.
    # Not answered, and refused to its caller; it may be carried out yet.
    _unanswered: Command | None = None
    _look_up: Future[bool] | None = None

    @property
    def is_high_level_flight_active(self) -> bool:
        """Whether the vehicle's log says that it flies on high-level commands."""
        if self._emergency.is_latched or self._setpoints.is_streaming:
            return False
        return self._flight.is_high_level(self._flight.supervisor)

    def start(self) -> None:
        """Begin to feed the watchdog, once there is a flight."""
        if self._safety.emergency_watchdog:
            self._handle.timer(_WATCHDOG_PERIOD, self._feed, steady=True)

    def send(self, command: Command, response: Result) -> Future[Result]:
        """Have a command sent, after the notice that setpoints stop if they were streamed.

        All that would have it refused, or be without effect, is checked before anything is sent
        that ends a stream. Landing and stopping supersede all commands and uploads before them. A
        landing of a vehicle that lands already is a success. The result of the future is
        ``response``.
        """

        def work(job: Job) -> Result:
            need = self._check(command, job)
            if need is Need.NOT_ADDRESSED:
                _send(command, self._crazyflie.high_level.guarded(lambda: job.is_valid))
            elif need is not Need.ON_GROUND:
                self._execute(command, job)
            return response

        return self._jobs.submit(command.name, work, is_flight=True, urgent=command.ends_flight)

    def check(self, command: Command) -> Future["Need"]:
        """Do all that `send` does before it sends anything; a takeoff arms the vehicle.

        The future fails where that of `send` would.
        """

        def work(job: Job) -> Need:
            return self._check(command, job)

        what = f"checking {command.name}"
        return self._jobs.submit(what, work, is_flight=True, urgent=command.ends_flight)

    def check_unanswered(self) -> bool:
        """Return whether a vehicle carries out a command that was refused as not answered, once.

        The vehicle is looked up for that: to be called whenever it has logged its state.
        """
        look_up = self._look_up
        if look_up is None:
            if self._unanswered is not None:
                self._look_up = self._jobs.submit("looking up a command", self._obeys)
            return False
        if not look_up.done():
            return False
        self._look_up = None
        return look_up.exception() is None and look_up.result()

    def notify(self, remain_valid_ms: int) -> None:
        """Announce that setpoints stop: at once on the ground, in flight with the next command."""
        may_fly = self._flight.supervisor is None or self._flight.is_flying
        if not (may_fly and self._setpoints.runs_motors):
            self._setpoints.notify_setpoints_stop(remain_valid_ms)
            return
        # Without a link nothing could be sent later, either.
        self._crazyflie.link()
        self._pending_notify = remain_valid_ms
        if self._notify_timer is not None:
            self._notify_timer.stop()
        self._notify_timer = self._handle.timer(NOTIFY_WINDOW, self._end_notify_window)

    def _end_notify_window(self):
        if self._notify_timer is not None:
            self._notify_timer.stop()
        if self._pending_notify is not None:
            self._handle.warn(
                f"{self._name}: notify_setpoints_stop was not sent: the vehicle flies on "
                "setpoints, and would drop; no high-level command has come within "
                f"{NOTIFY_WINDOW:g} s. It is sent together with the next one"
            )

    # Checks before a command.

    def _check(self, command, job):
        self._emergency.refuse()
        command.send(self._crazyflie.high_level.dry_run())
        if not self._is_addressed(command):
            return Need.NOT_ADDRESSED
        if not self._is_ready(command, job):
            return Need.ON_GROUND
        return Need.SETPOINTS_STOP if self._setpoints.is_streaming else Need.COMMAND

    def _is_addressed(self, command):
        is_addressed = self._crazyflie.high_level.is_addressed(command.group_mask)
        if is_addressed is None and self._setpoints.runs_motors:
            raise ServiceError(
                f"{command.name} is for the groups {command.group_mask:#x}, and it is not known "
                "which ones the vehicle belongs to: it flies on setpoints, and would drop if it "
                "ignored the command. Call set_group_mask first, or use the group mask 0"
            )
        return is_addressed is not False

    def _is_ready(self, command, job):
        if command.name == TAKEOFF:
            self._check_and_arm(job)
        elif command.name == LAND:
            if self._flight.is_on_ground():
                self._handle.info(
                    f"{self._name}: land is not sent, the vehicle is on the ground: it would "
                    "start its motors"
                )
                return False
        elif command.name != STOP:
            if self.refusal:
                raise ServiceError(f"no {command.name}: {self.refusal}")
            self._check_leaving_stream()
        return True

    def _check_leaving_stream(self):
        state = self._flight.supervisor
        if state is None or not self._setpoints.runs_motors:
            return
        if state.faults or SupervisorState.CAN_FLY not in state:
            raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")

    def _check_and_arm(self, job: Job) -> None:
        # Arms a vehicle that is not armed; blocks.
        if self._battery.charge >= Charge.LOW:
            raise ServiceError(f"no takeoff, {self._battery.words()}: charge or change it")
        if problem := self._flight.estimator_problem():
            raise ServiceError(f"no takeoff, the vehicle's estimate has not converged: {problem}")
        supervisor = self._crazyflie.supervisor.guarded(lambda: job.is_valid)
        state = self._state_once_armed(supervisor, job)
        if state is None:
            return
        if state.faults:
            raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")
        if state.reports_planner and self._flight.is_high_level(state):
            raise ServiceError(
                "no takeoff: the vehicle flies on high-level commands already; use go_to"
            )
        if SupervisorState.ARMED not in state:
            supervisor.arm()

    def _state_once_armed(self, supervisor: Supervisor, job: Job) -> SupervisorState | None:
        end = time.monotonic() + _REARMING
        while True:
            job.check()
            state = supervisor.read()
            if state is None or time.monotonic() > end:
                return state
            rearms = SupervisorState.AUTO_ARMED in state
            if not rearms or state.faults or SupervisorState.CAN_FLY in state:
                return state
            time.sleep(_REARMING / 10)

    # Sending.

    def _execute(self, command, job):
        job.check()
        number = self._setpoints.gate.high_level(self._handle.time())
        try:
            self._send_and_look_up(command, job)
        except CrazyflieError:
            self._setpoints.gate.resume(number)
            job.check()
            raise
        # One that nobody waits for any more was refused as well.
        is_refused = job.done.cancelled() and not command.ends_flight
        self._unanswered = command if is_refused else None
        self._setpoints.high_level_until(self._handle.time() + command.duration)
        if command.ends_flight:
            self._flight.end_accepted(command.duration)
        else:
            self._setpoints.gate.handle(Event.FLIGHT_CALLED)
            self._feeds_watchdog = True

    def _prepare_sending(self, command, job):
        # In the thread that sends: what is sent next is the command itself.
        if not job.is_valid or self._emergency.is_latched:
            return False
        if self._setpoints.is_streaming:
            try:
                self._setpoints.notify_setpoints_stop(self._pending_notify or 0, at_once=True)
            except LinkLostError:
                return False
        self._pending_notify = None
        if not command.ends_flight:
            self._flight.motion_sent()
        return True

    def _send_and_look_up(self, command, job):
        was_at_rest = self._flight.is_at_rest()
        is_sent = False

        def may_send():
            nonlocal is_sent
            may = self._prepare_sending(command, job)
            is_sent = is_sent or may
            return may

        try:
            _send(command, self._crazyflie.high_level.guarded(may_send))
        except (NoReplyError, LinkLostError) as error:
            if command.ends_flight or not is_sent:
                raise
            self._unanswered = command
            state = self._state_after(command, job, was_at_rest)
            if state is None:
                raise NoReplyError(
                    f"{error}; when the vehicle is heard again, it is landed if it obeys"
                ) from None
            self._unanswered = None
            if not self._shows(state, command, was_at_rest):
                raise NoReplyError(f"{error}; the vehicle's state is: {state.words()}") from None
            self._handle.warn(f"{self._name}: {error}: the vehicle's state shows that it obeys")

    def _state_after(self, command, job, was_at_rest):
        # The vehicle answers in the order in which it receives. It shows a command a little later.
        end = time.monotonic() + _LOOK_UP_LIMIT
        answered = None
        while True:
            job.check()
            try:
                state = self._flight.read()
            except LinkLostError:
                state = None
            now = time.monotonic()
            if state is not None:
                answered = now if answered is None else answered
                if self._shows(state, command, was_at_rest) or now - answered > REPORT_LAG:
                    return state
            elif now > end:
                return None
            time.sleep(_LOOK_UP_PERIOD)

    def _shows(self, state, command, was_at_rest):
        # Whether a state is that of a vehicle that obeys.
        if command.name == TAKEOFF:
            return self._flight.has_taken_off(state)
        return was_at_rest and self._flight.is_moving(state)

    def _obeys(self, job):
        # Whether it carries out what was refused. If it is not heard, it is looked up again.
        command = self._unanswered
        if command is None or self._emergency.is_latched or self._setpoints.is_streaming:
            self._unanswered = None
            return False
        state = self._state_after(command, job, True)
        if state is None:
            return False
        self._unanswered = None
        return self._shows(state, command, True)

    def _feed(self):
        # Also when the reply to the first command was lost.
        self._feeds_watchdog = self._feeds_watchdog or self.is_high_level_flight_active
        if self._feeds_watchdog and not self._emergency.is_latched:
            try:
                self._crazyflie.supervisor.feed_watchdog()
            except CrazyflieError as error:
                key = (self._name, "watchdog")
                self._handle.warn(f"{self._name}: watchdog not fed: {error}", 1.0, key)


def _send(command: Command, high_level: HighLevel) -> None:
    with contextlib.suppress(AlreadyLandingError):
        command.send(high_level)
