"""What is sent to a vehicle before its link ends, so that it neither falls nor is locked."""

import time
from typing import TYPE_CHECKING

from crazyflie_model.supervisor import SupervisorState
from crazyflie_py.errors import NoReplyError

if TYPE_CHECKING:
    from crazyflie_driver.vehicle import DriverVehicle

_LOOK_PERIOD = 0.1
_ANSWER_TIME = 0.3
"""How long the vehicle needs to begin what it was told, s."""


def take_leave(vehicle: "DriverVehicle", duration: float, limit: float) -> None:
    """Land a vehicle that flies and knows where it is, stop the motors of any other; blocks.

    The firmware lands without a link, too; zeros would stop it in the air. On the ground zero
    thrust is sent a hundred times, and that setpoints end: otherwise the vehicle would be locked
    2 s after the last of them.

    Parameters
    ----------
    vehicle : DriverVehicle
    duration : float
        Of the landing, s.
    limit : float
        How long it is waited for, s.

    Raises
    ------
    CrazyflieError
        There is no link, or the vehicle does not reply.
    """
    crazyflie = vehicle.crazyflie
    try:
        state = crazyflie.supervisor.read()
        is_flying = state is not None and SupervisorState.FLYING in state
    except NoReplyError:
        # One lost answer must not leave the motors of a vehicle on the ground running.
        is_flying = vehicle.is_flying
    if is_flying and vehicle.setpoints.knows_position(vehicle.now()):
        end = time.monotonic() + limit
        if vehicle.setpoints.is_streaming:
            vehicle.setpoints.hand_over()
        crazyflie.high_level.land(0.0, duration)
        if not _has_landed(crazyflie, end):
            return
    vehicle.setpoints.zeros()


def _has_landed(crazyflie, end):
    time.sleep(min(_ANSWER_TIME, max(0.0, end - time.monotonic())))
    while True:
        # "Flying" holds until 2 s after the motors have stopped.
        state = crazyflie.supervisor.read()
        if state is None or SupervisorState.HIGH_LEVEL_ACTIVE not in state:
            return True
        if time.monotonic() > end:
            return False
        time.sleep(_LOOK_PERIOD)
