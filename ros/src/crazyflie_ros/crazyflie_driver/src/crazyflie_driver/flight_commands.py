"""High-level commands to one vehicle, and its landings, until it is on the ground."""

import contextlib
import enum
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from crazyflie_driver.commands import (
    LAND,
    REPORT_LAG,
    STOP,
    TAKEOFF,
    Command,
    CommandedFlight,
    Need,
)
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.monitors import STEP, STEP_TIME, Charge, Next, Touchdown, landing_duration
from crazyflie_driver.positioning import PATIENCE
from crazyflie_driver.setpoint_gate import GateEvent, SetpointKind
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.vehicle_base import BaseVehicle, Job
from crazyflie_link.errors import AlreadyLandingError, CrazyflieError, LinkLostError, NoReplyError
from crazyflie_link.supervisor import Supervisor
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import ServiceError
from crazyflie_utils.timers import Timer

#: Time within which the notice that setpoints stop needs its command, s.
NOTIFY_WINDOW = 0.5
#: Period of feeding the watchdog (s): the firmware stops the motors after 1 s without.
_WATCHDOG_PERIOD = 0.2

#: Time in which a vehicle arms itself, s. Firmware 2026.08 disarms and arms itself 3 s after a
#: landing (0.16 s) and every 30 s on the ground (0.12 s).
_REARMING = 0.5
#: Time in which a vehicle that was armed can fly, s: two updates of its supervisor, or the spin-up
#: of brushless motors, whose speeds firmware 2026.08 watches for 0.2 s.
_SPIN_UP_LIMIT = 2.0

#: Time limit and period of the checks of a vehicle that has not answered a command (s). It is heard
#: again within 1 s, or gets a new link.
_LOOK_UP_LIMIT, _LOOK_UP_PERIOD = 1.5, 0.05

_MARGIN = 1.0  #: Time after its landing at which a vehicle that is still active lands again (s).
_LOG_DELAY = 0.5  #: Time after which the log shows the effect of a command, s.


class Reason(enum.Enum):
    """Why the driver lands a vehicle: in words, and the longest duration of the landing, s."""

    #: At 3.0 V under the load of hover a cell of 250 mAh has some 4 % left, which is 15 s; 5 s of
    #: them have gone by before the charge is critical.
    BATTERY = "the battery is critical", 5.0
    #: A process waits 10 s for a flight, and the last metre needs part of that.
    POSITIONING = "the vehicle's positioning is lost", 7.0
    POSES = f"external poses have not come for {PATIENCE:g} s", 7.0
    SHUTDOWN = "the driver is to end", 7.0
    NEEDED_NODE = "a node that the flight needs is to end", 7.0
    REMOVAL = "the vehicle is being removed", 7.0
    #: The caller of the command was told that it failed.
    NO_ANSWER = "a command that was refused as not answered is carried out", 7.0

    def __init__(self, words: str, limit: float):
        self.words, self.limit = words, limit


@dataclass(eq=False)
class FlightCommands:
    """Send a vehicle high-level commands; land it, and follow it to the ground.

    In flight the firmware stops its motors at the notice that setpoints stop, unless a command
    follows at once: so the notice is sent together with the command, which was checked before.

    For a command that moves a vehicle and is not answered, the vehicle's state decides whether it
    is a success. If the vehicle is not heard, the command fails, and the vehicle is landed if it is
    found to obey when it is heard again.

    No command may replace a landing of the driver's own. The firmware lands at a height and stops
    the motors there, also without a link. With a link the vehicle sinks further until it is on the
    ground: see `Touchdown`. The same holds for landings of the service.
    """

    _vehicle: BaseVehicle
    _log: LogTopics
    _setpoints: SetpointTopics
    _flight: CommandedFlight
    # Validity of the last setpoint, ms, in a notice that has not been sent yet.
    _pending_notify: int | None = None
    _notify_timer: Timer | None = None
    _feeds_watchdog: bool = False
    # The landing under way, to be followed to the ground; None after any other command.
    _touchdown: Touchdown | None = None
    # A command that was not answered and was refused to its caller, which may still be carried out,
    # with its number; and when the vehicle was first heard after that (s).
    _unanswered: tuple[int, Command] | None = None
    _heard: float | None = None
    # The end of the latest command that is sent, and the number of the latest one that is accepted.
    _latest: Future[None] = field(default_factory=Future)
    _accepted: int = 0
    # A landing of the driver's own: its reason, its latest command, and the times at which that was
    # sent and should have been carried out (s).
    _reason: Reason | None = None
    # When the vehicle was first seen to fly by its estimate, in this flight (s).
    _active_since: float | None = None
    _landing: Future[None] | None = None
    _begin: float = 0.0
    _end: float = 0.0

    @property
    def is_high_level_flight_active(self) -> bool:
        """Whether the vehicle's log says that it flies on high-level commands."""
        if self._vehicle.gate.is_emergency or self._setpoints.is_streaming:
            return False
        return self._flight.is_high_level(self._log.supervisor)

    def __post_init__(self) -> None:
        self._deliver_sent = self._vehicle.delivery.outlet(self._note_sent)

    def start(self) -> None:
        """Begin to feed the watchdog, once there is a flight."""
        if self._vehicle.server.emergency_watchdog:
            self._vehicle.handle.timer(_WATCHDOG_PERIOD, self._feed, steady=True)

    def send(self, command: Command) -> Future[None]:
        """Submit a command, which follows the notice that setpoints stop if they were streamed.

        Every cause of a refusal, and of no effect, is checked before a stream is ended. Landing and
        stopping supersede all commands and uploads before them. A landing of a vehicle that lands
        already is a success.
        """

        def work(job: Job) -> None:
            need = self._check(command, job)
            if need is Need.NOT_ADDRESSED:
                # Another client may have changed the groups.
                with contextlib.suppress(AlreadyLandingError):
                    command.send(self._vehicle.crazyflie.high_level.guarded(job.may_send))
            elif need is not Need.ON_GROUND:
                self._execute(command, job)

        return self._vehicle.jobs.submit(
            command.name, work, is_flight=True, urgent=command.ends_flight
        )

    def check(self, command: Command) -> Future[Need]:
        """Do all that `send` does before it sends anything; a takeoff arms the vehicle.

        The future fails where that of `send` would.
        """

        def work(job: Job) -> Need:
            need = self._check(command, job)
            # The command is a job of its own, which follows what has superseded this one.
            job.check()
            return need

        what = f"checking {command.name}"
        return self._vehicle.jobs.submit(what, work, is_flight=True, urgent=command.ends_flight)

    def end_stream(self) -> None:
        """Send "setpoints stop" if setpoints come: their end would lock the vehicle 2 s later."""
        if self._setpoints.is_streaming:
            self._setpoints.notify_setpoints_stop()

    def notify(self, remain_valid_ms: int) -> None:
        """Announce that setpoints stop: at once on the ground, in flight with the next command."""
        may_fly = self._log.supervisor is None or self._log.is_flying
        if not (may_fly and self._setpoints.runs_motors):
            self._setpoints.notify_setpoints_stop(remain_valid_ms)
            return
        # Without a link nothing could be sent later, either.
        self._vehicle.crazyflie.link()
        self._pending_notify = remain_valid_ms
        if self._notify_timer is not None:
            self._notify_timer.stop()
        self._notify_timer = self._vehicle.handle.timer(NOTIFY_WINDOW, self._end_notify_window)

    def land(self, reason: Reason) -> Future[None]:
        """Land; the result of the future is None once the vehicle has accepted it.

        Called again while the vehicle is active, it lands again if that has failed, or if the
        vehicle should be down.
        """
        if self._reason is None:
            detail = self._log.battery.words() if reason is Reason.BATTERY else reason.words
            self._vehicle.error(f"{detail}: landing")
        if self._reason is not Reason.BATTERY:
            self._reason = reason
        landing = self._landing
        if landing is None or not self._is_under_way(landing):
            height = self._log.height
            # Next to a table it may be below 0: it never climbs.
            ground = 0.0 if height is None else min(0.0, height)
            duration = landing_duration(
                height, self._vehicle.server.landing_duration, self._reason.limit
            )
            landing = self._landing = self._send_landing(
                Command(LAND, lambda h: h.land(ground, duration), duration, height=ground)
            )
        return landing

    def follow(self) -> None:
        """Take the next step of a landing; to be called after each log of the vehicle.

        A critical battery ends a flight by high-level commands, or on setpoints with a reference
        (a stream of thrust is landed by the node that sends it).
        """
        state = self._log.supervisor
        if state is None:
            return
        is_critical = self._log.battery.charge is Charge.CRITICAL
        is_active = self._is_active(state)
        obeys_late = self._obeys_late(state)
        if not is_active:
            self._active_since = None
        elif self._active_since is None:
            self._active_since = self._vehicle.handle.time()
        if is_active and is_critical:
            self.land(Reason.BATTERY)
        elif is_active and self._is_position_lost():
            self.land(Reason.POSITIONING)
        elif is_active and self._are_poses_lost():
            self.land(Reason.POSES)
        elif obeys_late:
            self.land(Reason.NO_ANSWER)
        elif is_active and self._reason is not None:
            self.land(self._reason)
        elif not is_active and self._is_logged():
            self._reason = self._landing = None
            if not is_critical:
                self._vehicle.gate.handle(GateEvent.BATTERY_RECOVERED)
        is_accepted = self._landing is not None and _is_accepted(self._landing)
        if is_accepted and self._reason is Reason.BATTERY:
            self._vehicle.gate.handle(GateEvent.BATTERY_CRITICAL)
        touchdown = self._touchdown
        if touchdown is not None and (is_accepted or self._landing is None):
            self._descend(touchdown, is_active)

    def _end_notify_window(self):
        if self._notify_timer is not None:
            self._notify_timer.stop()
        if self._pending_notify is not None:
            self._vehicle.warn(
                "notify_setpoints_stop was not sent: the vehicle flies on setpoints, and would "
                f"drop; no high-level command has come within {NOTIFY_WINDOW:g} s. It is sent "
                "together with the next one"
            )

    # Checks before a command.

    def _check(self, command, job):
        self._vehicle.refuse_after_emergency()
        command.send(self._vehicle.crazyflie.high_level.dry_run())
        if not self._is_addressed(command):
            return Need.NOT_ADDRESSED
        if command.name == LAND and self._flight.is_on_ground():
            text = "land is not sent, the vehicle is on the ground: it would start its motors"
            self._vehicle.info(text)
            return Need.ON_GROUND
        if command.name != STOP:
            self._check_estimate(command)
        if command.name == TAKEOFF:
            self._check_and_arm(job)
        elif not command.ends_flight:
            self._check_motion(command)
        return Need.SETPOINTS_STOP if self._setpoints.is_streaming else Need.COMMAND

    def _is_addressed(self, command):
        is_addressed = self._vehicle.crazyflie.high_level.is_addressed(command.group_mask)
        if is_addressed is None and self._setpoints.runs_motors:
            raise ServiceError(
                f"{command.name} is for the groups {command.group_mask:#x}, and it is not known "
                "which ones the vehicle belongs to: it flies on setpoints, and would drop if it "
                "ignored the command. Call set_group_mask first, or use the group mask 0"
            )
        return is_addressed is not False

    def _check_estimate(self, command):
        # Where a flight by the estimate goes on, a landing by it is the best that is left.
        problem = self._log.estimate_problem()
        if problem and command.name == LAND and self._setpoints.control is not SetpointKind.THRUST:
            self._vehicle.warn(f"land may end elsewhere: {problem}")
        elif problem:
            raise ServiceError(f"no {command.name}: {problem}")

    def _check_motion(self, command):
        battery, state = self._log.battery, self._log.supervisor
        if battery.charge is Charge.CRITICAL:
            raise ServiceError(f"no {command.name}: {battery.words()}")
        if self._reason is not None:
            raise ServiceError(f"no {command.name}: {self._reason.words}")
        if state is not None and self._setpoints.runs_motors:
            if state.faults or SupervisorState.CAN_FLY not in state:
                raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")

    def _check_and_arm(self, job: Job) -> None:
        # Arms a vehicle that is not armed; blocks.
        battery = self._log.battery
        if battery.charge >= Charge.LOW:
            raise ServiceError(f"no takeoff, {battery.words()}: charge or change it")
        if problem := self._flight.estimator_problem():
            raise ServiceError(f"no takeoff, the vehicle's estimate has not converged: {problem}")
        supervisor = self._vehicle.crazyflie.supervisor.guarded(job.may_send)
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
            self._vehicle.refuse_to_arm_in_stream()
            supervisor.arm()
            self._wait_for_spin_up(supervisor, job)

    def _wait_for_spin_up(self, supervisor: Supervisor, job: Job) -> None:
        # Until it can fly, the firmware refuses a takeoff.
        end = self._vehicle.monotonic() + _SPIN_UP_LIMIT
        while (state := supervisor.read()) is not None and SupervisorState.CAN_FLY not in state:
            job.check()
            if state.faults or self._vehicle.monotonic() > end:
                raise ServiceError(
                    f"the vehicle was armed, and cannot fly within {_SPIN_UP_LIMIT:g} s: see that "
                    f"each motor turns freely; its state is: {state.words()}"
                )
            self._vehicle.sleep(_REARMING / 10)

    def _state_once_armed(self, supervisor: Supervisor, job: Job) -> SupervisorState | None:
        end = self._vehicle.monotonic() + _REARMING
        while True:
            job.check()
            state = supervisor.read()
            if state is None or self._vehicle.monotonic() > end:
                return state
            rearms = SupervisorState.AUTO_ARMED in state
            if not rearms or state.faults or SupervisorState.CAN_FLY in state:
                return state
            self._vehicle.sleep(_REARMING / 10)

    # Sending.

    def _execute(self, command, job):
        job.check()
        gate, handle = self._vehicle.gate, self._vehicle.handle
        begin = handle.time()
        number = gate.high_level(begin)
        self._latest = job.done
        if command.name != LAND:
            self._touchdown = None
        is_accepted = True
        try:
            self._send_and_look_up(command, job, number)
        except AlreadyLandingError:
            # A success as well.
            is_accepted = False
        except CrazyflieError:
            gate.resume(number)
            job.check()
            raise
        # A command whose caller waits no longer was refused as well.
        is_refused = job.done.cancelled() and not command.ends_flight
        self._unanswered, self._heard = (number, command) if is_refused else None, None
        self._accepted = max(self._accepted, number)
        self._setpoints.high_level_end = handle.time() + command.duration
        if command.height is not None and (is_accepted or self._touchdown is None):
            self._touchdown = Touchdown(begin, command.height, command.duration)
        if command.ends_flight:
            self._flight.end_accepted(command.duration)
        else:
            gate.handle(GateEvent.FLIGHT_CALLED)
            self._feeds_watchdog = True

    def _prepare_sending(self, command, job, sent):
        # In the thread that sends, which changes nothing here: what is sent next is the command
        # itself.
        if not job.may_send() or self._vehicle.gate.is_emergency:
            return False
        is_notified = self._setpoints.may_have_priority
        # If they have none, the notice makes the next command begin at the estimated state.
        if is_notified:
            notify = self._vehicle.crazyflie.target.setpoints.notify_setpoints_stop
            try:
                notify(self._pending_notify or 0, at_once=True)
            except LinkLostError:
                return False
        sent[:] = self._vehicle.handle.time(), is_notified, not command.ends_flight
        self._deliver_sent(*sent)
        return True

    def _note_sent(self, moment, is_notified, is_motion):
        if is_notified:
            self._setpoints.was_notified(moment)
        self._pending_notify = None
        if is_motion:
            self._flight.motion_sent(moment)

    def _send_and_look_up(self, command, job, number):
        was_at_rest = self._flight.is_at_rest()
        # Of the latest sending, what `_note_sent` needs.
        sent: list[Any] = []
        may_send = partial(self._prepare_sending, command, job, sent)

        def note_sent():
            # Its delivery may come later.
            known = self._vehicle.handle.value("what was sent", lambda: list(sent))
            if known:
                self._note_sent(*known)
            return bool(known)

        try:
            command.send(self._vehicle.crazyflie.high_level.guarded(may_send))
            note_sent()
        except (NoReplyError, LinkLostError) as error:
            if not note_sent() or command.ends_flight:
                raise
            state, obeys = self._state_after(command, job, was_at_rest)
            if state is None:
                self._unanswered, self._heard = (number, command), None
                raise NoReplyError(
                    f"{error}; when the vehicle is heard again, it is landed if it obeys"
                ) from None
            if not obeys:
                raise NoReplyError(f"{error}; the vehicle's state is: {state.words()}") from None
            self._vehicle.warn(f"{error}: the vehicle's state shows that it obeys")

    def _state_after(self, command, job, was_at_rest):
        # Returns the state, None if the vehicle is silent, and whether it shows that it obeys.
        # The vehicle answers in the order in which it receives. It shows a command a little later.
        end = self._vehicle.monotonic() + _LOOK_UP_LIMIT
        answered = None
        while job.may_send():
            try:
                state = self._flight.read()
            except LinkLostError:
                state = None
            now = self._vehicle.monotonic()
            if state is not None:
                answered = now if answered is None else answered
                obeys = self._is_obeyed(command, state, was_at_rest)
                if obeys or now - answered > REPORT_LAG:
                    return state, obeys
            elif now > end:
                break
            self._vehicle.sleep(_LOOK_UP_PERIOD)
        return None, False

    def _is_obeyed(self, command, state, was_at_rest):
        if command.name == TAKEOFF:
            return self._flight.has_taken_off(state)
        return was_at_rest and self._flight.is_moving(state)

    def _obeys_late(self, state):
        # Whether the vehicle carries out what was refused, once. It may show a later command, too.
        if self._unanswered is None or not self._latest.done():
            return False
        (number, command), now = self._unanswered, self._vehicle.handle.time()
        self._heard = now if self._heard is None else self._heard
        is_streaming, is_emergency = self._setpoints.is_streaming, self._vehicle.gate.is_emergency
        is_replaced = number < self._accepted or is_streaming or is_emergency
        obeys = not is_replaced and self._is_obeyed(command, state, True)
        if obeys or is_replaced or now >= self._heard + _LOG_DELAY:
            self._unanswered = self._heard = None
        return obeys

    # Landings.

    def _is_active(self, state):
        if self.is_high_level_flight_active:
            return True
        is_flying = SupervisorState.FLYING in state
        return is_flying and self._setpoints.control is SetpointKind.REFERENCE

    def _is_position_lost(self):
        positioning = self._log.positioning
        return positioning is not None and positioning.is_lost(self._vehicle.handle.time())

    def _are_poses_lost(self):
        begin = self._active_since
        now = self._vehicle.handle.time()
        return begin is not None and self._log.agreement.is_lost(now, begin)

    def _is_logged(self):
        # Whether the log shows what was sent.
        is_sent = self._landing is None or self._landing.done()
        return is_sent and self._vehicle.handle.time() >= self._begin + _LOG_DELAY

    def _is_under_way(self, landing):
        if not landing.done():
            return True
        is_going_on = _is_accepted(landing) and not self._setpoints.is_streaming
        return is_going_on and self._vehicle.handle.time() < self._end

    def _descend(self, touchdown, is_active):
        log, now, height = self._log, self._vehicle.handle.time(), self._log.height
        is_over = not is_active and now >= touchdown.begin + _LOG_DELAY
        if is_over or self._setpoints.last_time > touchdown.begin:
            # The vehicle is down, or setpoints have taken the landing's place.
            self._touchdown = None
        if not is_active or self._touchdown is None:
            return
        step = touchdown.sample(now, height, log.vertical_speed, log.target_height)
        if step is Next.STOP:
            self._touchdown = None
            self._landing = self._send_landing(Command(STOP, lambda h: h.stop()))
        elif step is Next.DESCENT and height is not None:
            touchdown.descend(now)
            lower = height - STEP
            self._landing = self._send_landing(
                Command(LAND, lambda h: h.land_lower(lower, STEP_TIME), STEP_TIME)
            )

    def _send_landing(self, command):
        self._begin = self._vehicle.handle.time()
        self._end = self._begin + command.duration + _MARGIN
        return self.send(command)

    def _feed(self):
        # Also when the reply to the first command was lost.
        self._feeds_watchdog = self._feeds_watchdog or self.is_high_level_flight_active
        vehicle = self._vehicle
        if self._feeds_watchdog and not vehicle.gate.is_emergency:
            try:
                vehicle.crazyflie.supervisor.feed_watchdog()
            except CrazyflieError as error:
                vehicle.warn(f"watchdog not fed: {error}", 1.0, "watchdog")


def _is_accepted(sent):
    return sent.done() and sent.exception() is None
