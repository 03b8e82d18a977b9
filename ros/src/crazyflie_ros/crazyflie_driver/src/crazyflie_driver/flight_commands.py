"""High-level commands to one vehicle, and what keeps them from dropping it."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, TypeVar

from crazyflie_driver.battery import Battery, Charge
from crazyflie_driver.server_parameters import SafetyParameters
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.status import NOT_FLYABLE
from crazyflie_driver.worker import Job
from crazyflie_model.supervisor import SupervisorState
from crazyflie_py.errors import CrazyflieError
from crazyflie_py.high_level import HighLevel
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
    follows at once: so the notice is sent together with the command.

    Parameters
    ----------
    handle : NodeHandle
    vehicle : DriverVehicle
    setpoints : SetpointTopics
    battery : Battery
    safety : SafetyParameters

    Attributes
    ----------
    is_high_level : bool
        Whether the last flight was by high-level commands.
    """

    def __init__(
        self,
        handle: NodeHandle,
        vehicle: "DriverVehicle",
        setpoints: SetpointTopics,
        battery: Battery,
        safety: SafetyParameters,
    ):
        self.is_high_level = False
        self._handle = handle
        self._vehicle = vehicle
        self._crazyflie = vehicle.crazyflie
        self._setpoints = setpoints
        self._battery = battery
        self._safety = safety
        self._held: int | None = None
        self._holds = 0
        self._feeds_watchdog = False
        self._has_landed_low = False
        self._last_landing: Future[None] | None = None

    @property
    def are_flown(self) -> bool:
        """Whether the vehicle flies on high-level commands."""
        flies = self._vehicle.is_flying and not self._vehicle.is_emergency
        return flies and self.is_high_level and not self._setpoints.is_streaming

    def start(self) -> None:
        """Begin to feed the watchdog, once there is a flight."""
        if self._safety.emergency_watchdog:
            self._handle.timer(_WATCHDOG_PERIOD, self._feed, steady=True)

    def send(
        self,
        what: str,
        send: Callable[[HighLevel], Result],
        duration: float = 0.0,
        urgent: bool = False,
    ) -> Future[Result]:
        """Have a command sent, after a hand-over if setpoints were streamed.

        Parameters
        ----------
        what : str
        send : callable
            ``send(high_level)`` blocks; the future's result is its own.
        duration : float
            How long the vehicle will be at it, s.
        urgent : bool
            Whether it takes the place of all commands and uploads before it.
        """

        def work(job: Job) -> Result:
            self._vehicle.refuse_in_emergency()
            # In flight no reply may come between the two, so what can be refused is refused here.
            job.check()
            self._setpoints.gate.high_level(self._handle.time())
            if self._setpoints.is_streaming:
                self._setpoints.hand_over(self._held or 0)
            self._held = None
            response = send(self._crazyflie.high_level)
            self._setpoints.gate.open()
            self._setpoints.high_level_until(self._handle.time() + duration)
            self.is_high_level = True
            if what not in ("land", "stop"):
                self._feeds_watchdog = True
            return response

        return self._vehicle.do(what, work, is_flight=True, urgent=urgent)

    def land(self, height: float, duration: float, group_mask: int = 0) -> Future[None]:
        """Land, in the place of everything else."""
        return self.send(
            "land", lambda high_level: high_level.land(height, duration, group_mask), duration, True
        )

    def land_at_last(self) -> None:
        """Land; called again, it tries again what a silent link has prevented."""
        landing = self._last_landing
        if landing is None or (landing.done() and landing.exception() is not None):
            self._last_landing = self.land(0.0, self._safety.landing_duration)

    def notify(self, remain_valid_ms: int) -> None:
        """Announce that setpoints stop: at once on the ground, in flight with the next command.

        Raises
        ------
        CrazyflieError
            It cannot be sent.
        """
        self._setpoints.gate.open()
        if not (self._vehicle.is_flying and self._setpoints.is_flight):
            self._setpoints.hand_over(remain_valid_ms)
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

    def make_ready(self) -> None:
        """See to it that the vehicle can take off: arm it, if it is not armed; blocks.

        Raises
        ------
        ServiceError
            It cannot fly.
        CrazyflieError
            It refuses, or does not reply.
        """
        if self._battery.charge >= Charge.LOW:
            raise ServiceError(f"no takeoff, {self._battery.words()}: charge or change it")
        state = self._state_once_armed()
        if state is None:
            return
        if state & NOT_FLYABLE:
            raise ServiceError(f"the vehicle cannot fly, its state is: {state.words()}")
        if SupervisorState.ARMED not in state:
            self._crazyflie.supervisor.arm()

    def _state_once_armed(self) -> SupervisorState | None:
        end = time.monotonic() + _REARMING
        while True:
            state = self._crazyflie.supervisor.read()
            if state is None or time.monotonic() > end:
                return state
            rearms = SupervisorState.AUTO_ARMED in state
            if not rearms or state & (SupervisorState.CAN_FLY | NOT_FLYABLE):
                return state
            time.sleep(_REARMING / 10)

    def check_battery(self) -> None:
        """Land a high-level flight whose battery is critical, once."""
        if not self.are_flown:
            self._has_landed_low = False
        elif self._battery.charge is Charge.CRITICAL and not self._has_landed_low:
            self._has_landed_low = True
            self._handle.error(f"{self._vehicle.parameters.name}: {self._battery.words()}: landing")
            self.land(0.0, self._safety.landing_duration)

    def _feed(self):
        if self._feeds_watchdog and not self._vehicle.is_emergency:
            try:
                self._crazyflie.supervisor.feed_watchdog()
            except CrazyflieError as error:
                name = self._vehicle.parameters.name
                self._handle.warn(f"{name}: watchdog not fed: {error}", 1.0, (name, "watchdog"))
