"""The emergency stop of a vehicle, latched until it is removed."""

from collections.abc import Callable

from crazyflie_driver.jobs import Jobs
from crazyflie_driver.setpoint_gate import Event, SetpointGate
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_utils import ServiceError


class Emergency:
    """Stop a vehicle's motors for good, and refuse what would start them again.

    Parameters
    ----------
    crazyflie : crazyflie_link.Crazyflie
    gate : SetpointGate
    jobs : Jobs
    on_latched : callable
        ``on_latched()`` is called once the stop is on its way.
    """

    def __init__(
        self,
        crazyflie: Crazyflie,
        gate: SetpointGate,
        jobs: Jobs,
        on_latched: Callable[[], None],
    ):
        self._crazyflie = crazyflie
        self._gate = gate
        self._jobs = jobs
        self._on_latched = on_latched

    @property
    def is_latched(self) -> bool:
        """Whether there was an emergency stop."""
        return self._gate.is_emergency

    def latch(self) -> None:
        """Stop the motors at once and for good; does not block.

        Raises
        ------
        LinkLostError
            The vehicle is not heard; the stop is sent again and again, and arrives as soon as
            anything does.
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
