"""What a message of the filter means to the server."""

from crazyflie_msgs.msg import FilterStatus
from crazyflie_takeoff.flight_state import flight_state
from crazyflie_takeoff.server_states import Event, FilterReport

_EVENTS = {
    FilterStatus.PASSING: Event.FILTER_PASSES,
    FilterStatus.HOLDING: Event.FILTER_HOLDS,
    FilterStatus.SINKING: Event.FILTER_SINKS,
    FilterStatus.DOWN: Event.FILTER_DOWN,
    FilterStatus.EMERGENCY: Event.FILTER_EMERGENCY,
}


def report_of(message: FilterStatus) -> FilterReport:
    """Return what a filter's message means to the server.

    KeyError or ValueError: the message has a state that does not exist.
    """
    event, reason = _EVENTS[message.state], message.reason
    if message.takeoff_refusal and event in (Event.FILTER_PASSES, Event.FILTER_DOWN):
        event, reason = Event.FILTER_REFUSES, message.takeoff_refusal
    return FilterReport(event, flight_state(message.flight_state), message.is_commanded, reason)
