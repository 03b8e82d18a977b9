"""The choice between the takeoff server's control and the controller's."""

import math
from typing import Generic, TypeVar

from crazyflie_takeoff.flight_state import FlightState

#: A takeoff control older than this no longer keeps the controller out, s.
TAKEOFF_CONTROL_LIMIT = 0.5


Control = TypeVar("Control")


class ControlFilter(Generic[Control]):
    """Selects takeoff controls always, commanded ones when the vehicle is the controller's.

    That is in flight, or when the last takeoff control is older than
    `TAKEOFF_CONTROL_LIMIT`. Otherwise the last takeoff control is repeated.

    The toggle decides whether the vehicle is in flight until a flight state is known; then only
    the flight state does, so that a toggle and a state of the same event cannot cancel each other.
    A state of a vehicle on the ground also keeps the controller out when the server has died and
    zero thrust is not repeated: the controller may have a reference high above.

    A filter that has just started listens until a takeoff control comes or `stop_listening` is
    called; before that only a flight state can select the controller.
    """

    def __init__(self) -> None:
        self.state: FlightState | None = None  # As the server has published it last.
        self.is_commanded = False  # Whether a commanded control has ever come.
        self._toggled = False
        self._listening = True
        self._waiting: Control | None = None
        self._takeoff_control: Control | None = None
        self._takeoff_thrust = 0.0
        self._takeoff_time = math.inf

    @property
    def in_flight(self) -> bool:
        """Whether the vehicle is in flight, as far as is known."""
        return self._toggled if self.state is None else self.state.in_flight

    @property
    def is_on_ground(self) -> bool:
        """Whether nothing is known by which the vehicle is off the ground."""
        if self.in_flight or self._takeoff_thrust > 0.0:
            return False
        # A landing that has come to zero thrust is one of a vehicle on the ground.
        return self.state is not FlightState.TAKING_OFF

    @property
    def server_reports_ground(self) -> bool:
        """Whether the server sends the zero thrust of a vehicle on the ground."""
        sends_zero = self._takeoff_control is not None and self._takeoff_thrust <= 0.0
        return sends_zero and not self.in_flight and self.state in (None, FlightState.ON_GROUND)

    @property
    def remembered(self) -> FlightState | None:
        """The flight state for a server that has been restarted; None if unknown.

        A toggle to the ground is not remembered: after a toggle that was missed it means flight.
        """
        if self.state is None and self._toggled:
            return FlightState.FLYING
        return self.state

    def selects_controller(self, time: float, tolerance: float) -> bool:
        """Whether the vehicle would fall at ``time`` (s) without the controller.

        So it is in flight, unless a takeoff control has come in the last ``tolerance`` (s); and
        between takeoff and flight, or when the server has died above the ground, once the last
        takeoff control is older than `TAKEOFF_CONTROL_LIMIT`.
        """
        if self.in_flight:
            return self.takeoff_age(time) > tolerance
        return not self.is_on_ground and self.takeoff_age(time) > TAKEOFF_CONTROL_LIMIT

    def takeoff_age(self, time: float) -> float:
        """Return how old the last takeoff control is at ``time``, s; infinite without one."""
        return math.inf if self._takeoff_control is None else time - self._takeoff_time

    def advance(self, time: float) -> None:
        """Let time pass until ``time`` (s); after a reset of the clock ages count from there."""
        self._takeoff_time = min(self._takeoff_time, time)

    def end_flight(self) -> None:
        """Set the flight to ended, whatever the toggles."""
        self._toggled = False
        self._takeoff_thrust = 0.0

    def toggle(self) -> None:
        """Take a toggle of in_flight."""
        self._toggled = not self._toggled

    def takeoff(self, time: float, control: Control, thrust: float) -> Control:
        """Return what to pass on when a takeoff control with a thrust (m/s^2) has come."""
        self._listening = False
        self._waiting = None
        self._takeoff_control = control
        self._takeoff_thrust = thrust
        self._takeoff_time = time
        return control

    def commanded(self, time: float, control: Control) -> Control | None:
        """Return what to pass on when a commanded control has come at ``time`` (s), or None."""
        self.advance(time)
        self.is_commanded = True
        self._waiting = None
        if self.in_flight:
            return control
        if self._takeoff_control is None and self._listening:
            self._waiting = control
            return None
        # A thrust above zero came from a server that lifts the vehicle off without publishing a
        # flight state; the state that is known is then old.
        is_kept_down = self.state is FlightState.ON_GROUND and self._takeoff_thrust <= 0.0
        if is_kept_down or self.takeoff_age(time) <= TAKEOFF_CONTROL_LIMIT:
            return self._takeoff_control
        return control

    def stop_listening(self, time: float) -> Control | None:
        """Return what to pass on of what has waited until now, ``time`` (s), or None."""
        self._listening = False
        return None if self._waiting is None else self.commanded(time, self._waiting)
