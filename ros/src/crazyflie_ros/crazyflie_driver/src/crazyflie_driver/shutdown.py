"""What is sent to a vehicle before its link ends, so that it neither falls nor is locked."""

import time
from dataclasses import dataclass

from crazyflie_driver.emergency import Emergency
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.landings import Landings, Reason
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import CrazyflieError
from crazyflie_link.transmission import REPLY_LIMIT
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError

_EMERGENCY_LIMIT = 1.0  #: Time limit of the vehicle's confirmation of an emergency stop, s.

_LOOK_PERIOD = 0.1
_REACTION_TIME = 0.3  #: Time after which the vehicle has begun to land, s.


@dataclass(eq=False)
class Shutdown:
    """Land a vehicle that flies and can land by itself, stop the motors of any other.

    The firmware lands without a link, too; zero thrust would stop it in the air: so nothing is sent
    to a vehicle of which neither supervisor nor log report whether it flies.
    """

    _handle: NodeHandle
    _name: str
    _crazyflie: Crazyflie
    _emergency: Emergency
    _flight: FlightState
    _setpoints: SetpointTopics
    _landings: Landings

    def land_or_stop(self, limit: float) -> str:
        """Return what could not be done within a limit (s), empty if nothing; blocks.

        After an emergency stop only the vehicle's confirmation is waited for.
        """
        problem = ""
        crazyflie = self._crazyflie
        try:
            if self._emergency.is_latched:
                wait = crazyflie.supervisor.wait_for_emergency_stop
                if not wait(min(limit, _EMERGENCY_LIMIT)):
                    problem = "the emergency stop is not confirmed"
            elif crazyflie.connection_count:
                state = self._flight.read()
                if state is not None:
                    self._land_or_stop(state, limit)
                else:
                    # Unless it is the link that has been lost meanwhile.
                    crazyflie.link()
                    self._warn("it is not known whether the vehicle flies: it is left as it is")
        except (CrazyflieError, ServiceError, TimeoutError) as error:
            problem = f"its motors could not be stopped: {error}"
        if problem:
            self._warn(problem)
        return problem

    def _warn(self, text):
        self._handle.warn(f"{self._name}: {text}")

    def _land_or_stop(self, state, limit):
        setpoints = self._setpoints
        is_flying = SupervisorState.FLYING in state
        on_setpoints = is_flying and setpoints.runs_motors and setpoints.can_land_autonomously()
        if self._flight.is_high_level(state) or on_setpoints:
            end = time.monotonic() + limit
            self._landings.begin(Reason.REMOVAL).result(REPLY_LIMIT + limit)
            if not _has_landed(self._flight, end):
                return
        elif is_flying and not setpoints.is_streaming:
            # It has landed less than 2 s ago, and is not locked by silence; or it is another
            # client's.
            return
        # Otherwise the vehicle would be locked 2 s after the last setpoint.
        setpoints.send_zero_thrust()


def _has_landed(flight, end):
    time.sleep(min(_REACTION_TIME, max(0.0, end - time.monotonic())))
    while True:
        state = flight.read()
        if state is not None:
            # FLYING holds until 2 s after the motors have stopped.
            reported = SupervisorState.HIGH_LEVEL_ACTIVE
            if (reported if state.reports_planner else SupervisorState.FLYING) not in state:
                return True
        if time.monotonic() > end:
            return False
        time.sleep(_LOOK_PERIOD)
