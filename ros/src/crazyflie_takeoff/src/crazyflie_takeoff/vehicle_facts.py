"""What the driver knows of the vehicle: whether it may take off, and whether it can still fly."""

import math
from collections.abc import Callable

from crazyflie_model.supervisor import SupervisorState

MAX_FACT_AGE = 3.0  #: Age at which a status of the driver is unknown (s); it repeats each at 1 Hz.
#: Time in which a vehicle that arms itself has done so again (s): it disarms 3 s after a landing,
#: and every 30 s on the ground, for 0.2 s.
REARMING_TIME = 0.5
#: Time from the connection of the vehicle until zero thrust has reached its driver, which passes no
#: other thrust before that (s).
CONNECTION_TIME = 0.5

_READY = SupervisorState.ARMED | SupervisorState.CAN_FLY


class VehicleFacts:
    """Facts of the driver about a vehicle; times are s of one clock.

    On ``topic`` the driver publishes whether it is connected (None: there is no driver);
    ``resolve(topic)`` returns the absolute name. A fact that has never come, or that the driver
    does not know, ends no flight.
    """

    def __init__(self, topic: str | None, resolve: Callable[[str], str]):
        self._topic = "" if topic is None else resolve(topic)
        self._prefix = self._topic.rpartition("/")[0]
        # Time, and whether the driver is connected.
        self._connection = -math.inf, False
        # Time, state, and whether an emergency is latched.
        self._status = -math.inf, _READY, False
        self._unready_since = -math.inf
        self._is_flying: bool | None = None  # As the vehicle reports it; None if it does not.
        self._reported = -math.inf  # When it has reported a flight last.
        self._connected_since = -math.inf

    def set_connected(self, now: float, is_connected: bool) -> None:
        """Record whether the driver is connected to the vehicle."""
        if is_connected and not self._connection[1]:
            self._connected_since = now
        self._connection = now, is_connected

    def set_status(
        self, now: float, state: SupervisorState, is_known: bool, is_emergency: bool
    ) -> None:
        """Record the vehicle's state, if it is known, and whether an emergency is latched."""
        self._is_flying = SupervisorState.FLYING in state if is_known else None
        if self._is_flying:
            self._reported = now
        if not is_known:
            state |= _READY
        was_ready = _READY in self._status[1]
        if was_ready and _READY not in state and math.isfinite(self._status[0]):
            self._unready_since = now
        self._status = now, state, is_emergency

    def takeoff_refusal(self, now: float) -> str:
        """Return why the vehicle must not take off; empty if it may."""
        return self.connection_refusal(now) or self._fault(now) or self._unready(now)

    def connection_refusal(self, now: float) -> str:
        """Return that the driver is not connected, and what to do; empty if it is."""
        if not (fault := self._connection_fault(now)):
            return ""
        return (
            f"{fault}; is the vehicle on? It is added by: roslaunch crazyflie_driver "
            f"crazyflie_add.launch uri:=ADDRESS tf_prefix:={self._prefix.strip('/')}"
        )

    def flight_fault(self, now: float, begin: float) -> str:
        """Return why a flight that has begun at ``begin`` cannot go on; empty if it can.

        A vehicle that reports no flight any more has no motor that turns. When it can fly again,
        somebody may have it in a hand.
        """
        was_connected = math.isfinite(self._connection[0])
        fault = (self._connection_fault(now) if was_connected else "") or self._fault(now)
        if fault:
            return fault
        if SupervisorState.ARMED not in self._state(now):
            return "the vehicle is not armed"
        is_known = now - self._status[0] <= MAX_FACT_AGE
        if is_known and self._is_flying is False and self._reported >= begin:
            return "the vehicle does not fly any more: has it restarted?"
        return ""

    def _state(self, now):
        time, state, _ = self._status
        return state if now - time <= MAX_FACT_AGE else _READY

    def _connection_fault(self, now):
        time, is_connected = self._connection
        is_recent = now - time <= MAX_FACT_AGE
        if not self._topic or (is_recent and is_connected):
            return ""
        text = "false" if is_recent else "nothing"
        return f"the driver is not connected to the vehicle, {text} on {self._topic}"

    def _fault(self, now):
        time, _, is_emergency = self._status
        if is_emergency and now - time <= MAX_FACT_AGE:
            return "the vehicle was stopped by emergency; remove it, restart it and add it again"
        if faults := self._state(now).faults:
            return f"the vehicle cannot fly, its state is: {faults.words()}; {faults.remedy}"
        return ""

    def is_soon_ready(self, now: float) -> bool:
        """Return whether one that may take off soon was connected, or has disarmed, just now."""
        is_new = now - self._connected_since < CONNECTION_TIME
        return self._arms_again(now) or (is_new and not self.takeoff_refusal(now))

    def _arms_again(self, now):
        """Return whether a vehicle that arms itself has just disarmed."""
        state = self._state(now)
        arms_itself = SupervisorState.AUTO_ARMED in state and _READY not in state
        return arms_itself and now - self._unready_since < REARMING_TIME

    def _unready(self, now):
        state = self._state(now)
        if _READY in state or self._arms_again(now):
            return ""
        if SupervisorState.ARMED in state or SupervisorState.AUTO_ARMED in state:
            return f"the vehicle cannot fly yet, its state is: {state.words()}"
        how = f"; call {self._prefix}/arm" if self._topic else ""
        return f"the vehicle is not armed{how}"
