"""High-level commands to one vehicle, and what keeps them from dropping it."""

import contextlib
import time
from concurrent.futures import Future
from typing import TYPE_CHECKING, TypeVar

from crazyflie_driver.battery import Battery, Charge
from crazyflie_driver.command import LAND, STOP, TAKEOFF, Command
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.server_parameters import SafetyParameters
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.status import NOT_FLYABLE
from crazyflie_driver.worker import Job
from crazyflie_link.errors import AlreadyLandingError, CrazyflieError, LinkLostError
from crazyflie_link.high_level import ALL_GROUPS
from crazyflie_link.supervisor import Supervisor
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError

if TYPE_CHECKING:
    from crazyflie_driver.vehicle import DriverVehicle

Result = TypeVar("Result")

HOLD = 0.5
"""How long a notice that setpoints stop waits for the command that it belongs to, s."""

_WATCHDOG_PERIOD = 0.2
"""The firmware gives up after 1 s without being fed."""

_REARMING = 0.5
"""How long a takeoff waits for a vehicle that arms itself, s. Firmware 2026.08 disarms and arms
itself 3 s after a landing (0.16 s) and every 30 s on the ground (0.08 s)."""


class FlightCommands:
    """Send a vehicle high-level commands.

    In flight the firmware stops its motors at the notice that setpoints stop, unless a command
    follows at once: so the notice is sent together with the command, which was checked before.

    Parameters
    ----------
    handle : NodeHandle
    vehicle : DriverVehicle
    setpoints : SetpointTopics
    battery : Battery
    safety : SafetyParameters

    Attributes
    ----------
    flight : FlightState
    """

    def __init__(
        self,
        handle: NodeHandle,
        vehicle: "DriverVehicle",
        setpoints: SetpointTopics,
        battery: Battery,
        safety: SafetyParameters,
    ):
        self.flight = FlightState(handle, vehicle, setpoints)
        self._handle = handle
        self._vehicle = vehicle
        self._crazyflie = vehicle.crazyflie
        self._setpoints = setpoints
        self._battery = battery
        self._safety = safety
        self._held: int | None = None
        self._holds = 0
        self._feeds_watchdog = False
        # By what has begun them.
        self._landings: dict[str, Future[None]] = {}

    @property
    def are_flown(self) -> bool:
        """Whether the vehicle's log says that it flies on high-level commands."""
        if self._vehicle.is_emergency or self._setpoints.is_streaming:
            return False
        return self.flight.is_flight(self._vehicle.supervisor)

    def start(self) -> None:
        """Begin to feed the watchdog, once there is a flight."""
        if self._safety.emergency_watchdog:
            self._handle.timer(_WATCHDOG_PERIOD, self._feed, steady=True)

    def send(self, command: Command, response: Result) -> Future[Result]:
        """Have a command sent, after a hand-over if setpoints were streamed.

        All that would have it refused, or be without effect, is looked at before anything is
        sent that ends a stream. Landing and stopping take the place of all commands and uploads
        before them.

        Parameters
        ----------
        command : Command
        response
            The result of the future.
        """

        def work(job: Job) -> Result:
            self._vehicle.refuse_in_emergency()
            high_level = self._crazyflie.high_level
            command.send(high_level.dry_run())
            if self._is_addressed(command):
                if self._is_ready(command, job):
                    self._execute(command, job)
            else:
                command.send(high_level.guarded(lambda: job.is_valid))
            return response

        return self._vehicle.do(command.name, work, is_flight=True, urgent=command.ends_flight)

    def land(
        self, height: float, duration: float, group_mask: int, response: Result
    ) -> Future[Result]:
        """Land, in the place of everything else, unless the vehicle is on the ground or lands."""

        def send(high_level):
            with contextlib.suppress(AlreadyLandingError):
                high_level.land(height, duration, group_mask)

        return self.send(Command(LAND, send, duration, group_mask), response)

    def land_at_last(self) -> None:
        """Land; called again, it tries again what a silent link has prevented."""
        self._try_to_land("end")

    def check_battery(self) -> None:
        """Land a high-level flight whose battery is critical; called again, see `land_at_last`."""
        if not self.are_flown:
            self._landings.clear()
        elif self._battery.charge is Charge.CRITICAL:
            if "battery" not in self._landings:
                name = self._vehicle.parameters.name
                self._handle.error(f"{name}: {self._battery.words()}: landing")
            self._try_to_land("battery")

    def notify(self, remain_valid_ms: int) -> None:
        """Announce that setpoints stop: at once on the ground, in flight with the next command.

        Raises
        ------
        CrazyflieError
            It cannot be sent.
        """
        state = self._vehicle.supervisor
        may_fly = state is None or SupervisorState.FLYING in state
        if not (may_fly and self._setpoints.is_flight):
            self._setpoints.notify_setpoints_stop(remain_valid_ms)
            return
        # Without a link nothing could be sent later, either.
        self._crazyflie.link()
        self._held = remain_valid_ms
        self._holds += 1
        hold = self._holds
        timer = self._handle.timer(HOLD, lambda: end())

        def end():
            timer.stop()
            if hold == self._holds and self._held is not None:
                self._handle.warn(
                    f"{self._vehicle.parameters.name}: notify_setpoints_stop was not sent: the "
                    "vehicle flies on setpoints, and would drop; no high-level command has come "
                    f"within {HOLD:g} s. It is sent together with the next one"
                )

    # What is looked at before a command.

    def _is_addressed(self, command):
        is_addressed = self._crazyflie.high_level.is_addressed(command.group_mask)
        if is_addressed is None and self._setpoints.is_flight:
            raise ServiceError(
                f"{command.name} is for the groups {command.group_mask:#x}, and it is not known "
                "which ones the vehicle belongs to: it flies on setpoints, and would drop if it "
                "ignored the command. Call set_group_mask first, or use the group mask 0"
            )
        return is_addressed is not False

    def _is_ready(self, command, job):
        if command.name == TAKEOFF:
            self.make_ready(job)
        elif command.name == LAND:
            if self.flight.is_on_ground():
                self._handle.info(
                    f"{self._vehicle.parameters.name}: land is not sent, the vehicle is on the "
                    "ground: it would start its motors"
                )
                return False
        elif command.name != STOP:
            self._refuse_to_leave_stream()
        return True

    def _refuse_to_leave_stream(self):
        state = self._vehicle.supervisor
        if state is None or not self._setpoints.is_flight:
            return
        if state & NOT_FLYABLE or SupervisorState.CAN_FLY not in state:
            raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")

    def make_ready(self, job: Job) -> None:
        """See to it that the vehicle can take off: arm it, if it is not armed; blocks.

        Raises
        ------
        ServiceError
            It cannot fly, or flies by its high-level commander, or the job was given up.
        CrazyflieError
            It refuses, or does not reply.
        """
        if self._battery.charge >= Charge.LOW:
            raise ServiceError(f"no takeoff, {self._battery.words()}: charge or change it")
        supervisor = self._crazyflie.supervisor.guarded(lambda: job.is_valid)
        state = self._state_once_armed(supervisor, job)
        if state is None:
            return
        if state & NOT_FLYABLE:
            raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")
        if state.reports_planner and self.flight.is_flight(state):
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
            if not rearms or state & (SupervisorState.CAN_FLY | NOT_FLYABLE):
                return state
            time.sleep(_REARMING / 10)

    # Sending.

    def _execute(self, command, job):
        job.check()
        number = self._setpoints.gate.high_level(self._handle.time())
        try:
            command.send(
                self._crazyflie.high_level.guarded(lambda: self._prepare_sending(command, job))
            )
        except CrazyflieError:
            self._setpoints.gate.resume(number)
            job.check()
            raise
        self._setpoints.high_level_until(self._handle.time() + command.duration)
        if command.ends_flight:
            self.flight.end_accepted(command.duration)
        else:
            self._setpoints.gate.open()
            self._feeds_watchdog = True

    def _prepare_sending(self, command, job):
        # In the thread that sends: what is sent next is the command itself.
        if not job.is_valid or self._vehicle.is_emergency:
            return False
        if self._setpoints.is_streaming:
            try:
                self._setpoints.notify_setpoints_stop_now(self._held or 0)
            except LinkLostError:
                return False
        self._held = None
        if not command.ends_flight:
            self.flight.motion_sent()
        return True

    def _try_to_land(self, reason):
        landing = self._landings.get(reason)
        if landing is None or (landing.done() and landing.exception() is not None):
            self._landings[reason] = self.land(0.0, self._safety.landing_duration, ALL_GROUPS, None)

    def _feed(self):
        # Also when the reply to the first command was lost.
        self._feeds_watchdog = self._feeds_watchdog or self.are_flown
        if self._feeds_watchdog and not self._vehicle.is_emergency:
            try:
                self._crazyflie.supervisor.feed_watchdog()
            except CrazyflieError as error:
                name = self._vehicle.parameters.name
                self._handle.warn(f"{name}: watchdog not fed: {error}", 1.0, (name, "watchdog"))
