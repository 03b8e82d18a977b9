"""What is sent to a vehicle before its link ends, so that it neither falls nor is locked."""

import contextlib
import time
from typing import TYPE_CHECKING

from crazyflie_link.errors import AlreadyLandingError
from crazyflie_model.supervisor import SupervisorState

if TYPE_CHECKING:
    from crazyflie_driver.vehicle import DriverVehicle

_LOOK_PERIOD = 0.1
_ANSWER_TIME = 0.3
"""How long the vehicle needs to begin what it was told, s."""


def take_leave(vehicle: "DriverVehicle", duration: float, limit: float) -> bool:
    """Land a vehicle that flies and knows where it is, stop the motors of any other; blocks.

    The firmware lands without a link, too; zeros would stop it in the air: so nothing is sent to
    a vehicle of which neither supervisor nor log tell whether it flies. On the ground zero
    thrust is sent a hundred times, and that setpoints end: otherwise the vehicle would be locked
    2 s after the last of them.

    Parameters
    ----------
    vehicle : DriverVehicle
    duration : float
        Of the landing, s.
    limit : float
        How long it is waited for, s.

    Returns
    -------
    bool
        Whether it is known if the vehicle flies; nothing was sent otherwise.

    Raises
    ------
    CrazyflieError
        There is no link, or the vehicle does not reply.
    """
    state = vehicle.read_state()
    if state is None:
        return False
    setpoints = vehicle.setpoints
    is_flying = SupervisorState.FLYING in state
    on_setpoints = is_flying and setpoints.is_flight and setpoints.knows_position(vehicle.now())
    if vehicle.commands.flight.is_flight(state) or on_setpoints:
        end = time.monotonic() + limit
        if setpoints.is_streaming:
            setpoints.notify_setpoints_stop()
        with contextlib.suppress(AlreadyLandingError):
            vehicle.crazyflie.high_level.land(0.0, duration)
        if not _has_landed(vehicle, end):
            return True
    elif is_flying and not setpoints.is_streaming:
        # It has landed less than 2 s ago, and is not locked by silence; or it is another client's.
        return True
    setpoints.send_zero_thrust()
    return True


def _has_landed(vehicle, end):
    time.sleep(min(_ANSWER_TIME, max(0.0, end - time.monotonic())))
    while True:
        state = vehicle.read_state()
        if state is not None:
            # FLYING holds until 2 s after the motors have stopped.
            reported = SupervisorState.HIGH_LEVEL_ACTIVE
            if (reported if state.reports_planner else SupervisorState.FLYING) not in state:
                return True
        if time.monotonic() > end:
            return False
        time.sleep(_LOOK_PERIOD)
