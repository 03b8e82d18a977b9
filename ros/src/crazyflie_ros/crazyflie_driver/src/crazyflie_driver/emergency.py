"""The emergency stop of a vehicle, latched until it is removed."""

from collections.abc import Callable
from dataclasses import dataclass

from crazyflie_driver.jobs import Jobs
from crazyflie_driver.setpoint_gate import Event, SetpointGate
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_utils import ServiceError


@dataclass(eq=False)
class Emergency:
    """Stop a vehicle's motors for good, and refuse what would start them again."""

    _crazyflie: Crazyflie
    _gate: SetpointGate
    _jobs: Jobs
    _on_latched: Callable[[], None]

    @property
    def is_latched(self) -> bool:
        """Whether there was an emergency stop."""
        return self._gate.is_emergency

    def latch(self) -> None:
        """Stop the motors at once and for good; does not block.

        Raises `LinkLostError` if the vehicle is not heard; the stop is repeated until it arrives.
        """
        self._gate.handle(Event.EMERGENCY_STOP)
        self._crazyflie.supervisor.emergency_stop()
        self._jobs.supersede("the emergency stop")
        self._on_latched()
        self._crazyflie.link()

    def refuse(self) -> None:
        """Raise `ServiceError` after an emergency stop."""
        if self.is_latched:
            raise ServiceError(
                f"emergency stop: remove {self._crazyflie.address.uri}, restart the vehicle and "
                "add it again"
            )
