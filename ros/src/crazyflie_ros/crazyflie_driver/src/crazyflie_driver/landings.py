"""Landings that the driver begins, from the command until the vehicle stands."""

import enum
from concurrent.futures import Future
from dataclasses import dataclass

from crazyflie_driver.context import VehicleContext
from crazyflie_driver.flight_commands import LAND, STOP, Command, FlightCommands
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.monitors import STEP, STEP_TIME, Charge, Next, landing_duration
from crazyflie_driver.setpoint_gate import GateEvent
from crazyflie_driver.setpoint_topics import Control, SetpointTopics
from crazyflie_model.supervisor import SupervisorState

_MARGIN = 1.0  #: A vehicle that is active this long after its landing, s, lands again.
_LOG_DELAY = 0.5  #: Time after which the log shows the effect of a command, s.


class Reason(enum.Enum):
    """Why the driver lands a vehicle: in words, and the longest duration of the landing, s."""

    #: At 3.0 V under the load of hover a cell of 250 mAh has some 4 % left, which is 15 s; 5 s of
    #: them have gone by before the charge is critical.
    BATTERY = "the battery is critical", 5.0
    #: A process waits 10 s for a flight, and the last metre takes its time.
    POSITIONING = "the vehicle's positioning is lost", 7.0
    SHUTDOWN = "the driver is to end", 7.0
    REMOVAL = "the vehicle is being removed", 7.0
    #: Its caller believes that it failed.
    NO_ANSWER = "a command that was refused as not answered is carried out", 7.0

    @property
    def words(self) -> str:
        """The reason, for messages."""
        return self.value[0]

    @property
    def limit(self) -> float:
        """The longest duration of the landing, s."""
        return self.value[1]


@dataclass(eq=False)
class Landings:
    """Land a vehicle and follow it to the ground; no other command may replace the landing.

    The firmware lands at a height and stops the motors there, also without a link. With a link the
    vehicle sinks further until it stands: see `Touchdown`. So it does in landings of the service.
    """

    _context: VehicleContext
    _log: LogTopics
    _setpoints: SetpointTopics
    _commands: FlightCommands
    _reason: Reason | None = None
    _sent: Future[None] | None = None
    # When it was sent, and when it should have been carried out, s.
    _begin: float = 0.0
    _end: float = 0.0

    def begin(self, reason: Reason) -> Future[None]:
        """Land; the result of the future is None once the vehicle has accepted it.

        Called again while the vehicle is active, it lands again if that has failed, or if the
        vehicle should be down.
        """
        if self._reason is None:
            detail = self._log.battery.words() if reason is Reason.BATTERY else reason.words
            self._context.handle.error(f"{self._context.name}: {detail}: landing")
        if self._reason is not Reason.BATTERY:
            self._reason = reason
        self._commands.refusal = self._refusal()
        sent = self._sent
        if sent is None or not self._is_under_way(sent):
            height = self._log.height
            # Beside a table it may be below 0: it never climbs.
            ground = 0.0 if height is None else min(0.0, height)
            duration = landing_duration(
                height, self._context.server.landing_duration, self._reason.limit
            )
            sent = self._sent = self._send(
                Command(LAND, lambda h: h.land(ground, duration), duration, height=ground)
            )
        return sent

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
        obeys_late = self._commands.check_unanswered()
        if is_active and is_critical:
            self.begin(Reason.BATTERY)
        elif is_active and self._is_position_lost():
            self.begin(Reason.POSITIONING)
        elif obeys_late:
            self.begin(Reason.NO_ANSWER)
        elif is_active and self._reason is not None:
            self.begin(self._reason)
        elif not is_active and self._is_logged():
            self._reason = self._sent = None
            if not is_critical:
                self._context.gate.handle(GateEvent.BATTERY_RECOVERED)
        self._commands.refusal = self._refusal()
        is_accepted = self._sent is not None and _is_accepted(self._sent)
        if is_accepted and self._reason is Reason.BATTERY:
            self._context.gate.handle(GateEvent.BATTERY_CRITICAL)
        touchdown = self._commands.touchdown
        if touchdown is not None and (is_accepted or self._sent is None):
            self._descend(touchdown, is_active)

    def _is_active(self, state):
        if self._commands.is_high_level_flight_active:
            return True
        is_flying = SupervisorState.FLYING in state
        return is_flying and self._setpoints.control is Control.REFERENCE

    def _is_position_lost(self):
        positioning = self._log.positioning
        return positioning is not None and positioning.is_lost(self._context.handle.time())

    def _refusal(self):
        if self._log.battery.charge is Charge.CRITICAL:
            return self._log.battery.words()
        return "" if self._reason is None else self._reason.words

    def _is_logged(self):
        # Whether the log shows what was sent.
        is_sent = self._sent is None or self._sent.done()
        return is_sent and self._context.handle.time() >= self._begin + _LOG_DELAY

    def _is_under_way(self, sent):
        if not sent.done():
            return True
        is_going_on = _is_accepted(sent) and not self._setpoints.is_streaming
        return is_going_on and self._context.handle.time() < self._end

    def _descend(self, touchdown, is_active):
        log, now, height = self._log, self._context.handle.time(), self._log.height
        is_over = not is_active and now >= touchdown.begin + _LOG_DELAY
        if is_over or self._setpoints.last_time > touchdown.begin:
            # The vehicle is down, or setpoints have taken the landing's place.
            self._commands.touchdown = None
        if not is_active or self._commands.touchdown is None:
            return
        step = touchdown.sample(now, height, log.vertical_speed, log.target_height)
        if step is Next.STOP:
            self._commands.touchdown = None
            self._sent = self._send(Command(STOP, lambda h: h.stop()))
        elif step is Next.DESCENT and height is not None:
            touchdown.descend(now)
            lower = height - STEP
            self._sent = self._send(
                Command(LAND, lambda h: h.land_lower(lower, STEP_TIME), STEP_TIME)
            )

    def _send(self, command):
        self._begin = self._context.handle.time()
        self._end = self._begin + command.duration + _MARGIN
        return self._commands.send(command, None)


def _is_accepted(sent):
    return sent.done() and sent.exception() is None
