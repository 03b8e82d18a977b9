"""The states of server and filter as messages have them."""

from crazyflie_msgs.msg import FilterStatus, FlightStatus
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.server_states import Event, FilterReport

CODES: dict[FlightState | None, int] = {
    None: FlightStatus.UNKNOWN,
    **{state: getattr(FlightStatus, state.name) for state in FlightState},
}
"""Flight state -> constant of `FlightStatus`."""

_FLIGHT_STATES = {code: state for state, code in CODES.items()}

_EVENTS = {
    FilterStatus.PASSING: Event.FILTER_PASSES,
    FilterStatus.HOLDING: Event.FILTER_HOLDS,
    FilterStatus.SINKING: Event.FILTER_SINKS,
    FilterStatus.DOWN: Event.FILTER_DOWN,
    FilterStatus.EMERGENCY: Event.FILTER_EMERGENCY,
}


def report_of(message: FilterStatus) -> FilterReport:
    """Return what a filter's message means to the server.

    Raises
    ------
    KeyError
        The message has a state that does not exist.
    """
    event, reason = _EVENTS[message.state], message.reason
    if message.takeoff_refusal and event in (Event.FILTER_PASSES, Event.FILTER_DOWN):
        event, reason = Event.FILTER_REFUSES, message.takeoff_refusal
    return FilterReport(event, _FLIGHT_STATES[message.flight_state], message.is_commanded, reason)
