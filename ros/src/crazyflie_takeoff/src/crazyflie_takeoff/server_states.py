"""States and events of the takeoff server, and what it knows of the control filter."""

import enum
from typing import NamedTuple

from crazyflie_takeoff.flight_state import FlightState


class ServerState(enum.Enum):
    """What the server does."""

    RECOVERING = enum.auto()  # Sends nothing until it knows the state of the flight.
    ON_GROUND = enum.auto()  # Repeats zero thrust.
    LIFTING_OFF = enum.auto()  # Sends the open-loop thrust.
    CLIMBING = enum.auto()  # The controller flies to the hover point.
    FLYING = enum.auto()
    DESCENDING = enum.auto()  # Sends references that sink.
    RAMPING_DOWN = enum.auto()  # Sends a thrust that decreases.
    TOUCHING_DOWN = enum.auto()  # Repeats zero thrust until the vehicle is on the ground.
    YIELDED = enum.auto()  # The filter brings the vehicle down.

    @property
    def flight_state(self) -> FlightState | None:
        """What is published meanwhile; None for nothing."""
        return _FLIGHT_STATES.get(self)


_FLIGHT_STATES = {
    ServerState.ON_GROUND: FlightState.ON_GROUND,
    ServerState.LIFTING_OFF: FlightState.TAKING_OFF,
    ServerState.CLIMBING: FlightState.TAKING_OFF,
    ServerState.FLYING: FlightState.FLYING,
    ServerState.DESCENDING: FlightState.DESCENDING,
    ServerState.RAMPING_DOWN: FlightState.LANDING,
    ServerState.TOUCHING_DOWN: FlightState.LANDING,
    ServerState.YIELDED: FlightState.LANDING,
}


class Event(enum.Enum):
    """What can change the state of the server."""

    RECOVER = enum.auto()  # All evidence has come, or the time for it is over.
    TAKEOFF = enum.auto()  # The service was called, and no check refuses it.
    LAND = enum.auto()  # Service, critical battery, end of the launch, fault in a takeoff.
    TICK = enum.auto()  # Time has passed.
    FILTER_PASSES = enum.auto()
    FILTER_HOLDS = enum.auto()  # It keeps the vehicle in place until a control comes back.
    FILTER_SINKS = enum.auto()  # It brings the vehicle down.
    FILTER_DOWN = enum.auto()  # It has brought the vehicle down; motors off.
    FILTER_EMERGENCY = enum.auto()  # It has stopped the motors at once.
    FILTER_REFUSES = enum.auto()  # It keeps the motors off and passes no takeoff on.


STOPS = (Event.FILTER_EMERGENCY, Event.FILTER_REFUSES)
#: With these the filter has the vehicle.
TAKEOVERS = (Event.FILTER_SINKS, Event.FILTER_DOWN, *STOPS)


class FilterReport(NamedTuple):
    """What the filter has published last."""

    event: Event = Event.FILTER_PASSES
    remembered: FlightState | None = None  # Flight state that it received last.
    is_commanded: bool = True  # Whether a controller sends commands, or may do so.
    reason: str = ""  # Why it does not pass controls on, or refuses takeoffs.


NO_FILTER = FilterReport()  #: Before a filter has published anything.
