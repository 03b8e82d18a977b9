"""What the takeoff control filter publishes about itself: typed, as text, and as diagnostics."""

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from crazyflie_msgs.msg import FilterStatus, FlightStatus
from crazyflie_takeoff import diagnostics
from crazyflie_takeoff.filter_states import FilterState
from crazyflie_takeoff.flight_state import FlightState
from crazyflie_takeoff.safe_filter import SafeFilter, Status
from crazyflie_takeoff.takeoff_control_filter_parameters import TakeoffControlFilterParameters
from crazyflie_utils import NodeHandle
from crazyflie_utils.vectors import stamped


class FilterStatusPublisher:
    """Publishes the filter's status when it changes, and logs why."""

    def __init__(self, handle: NodeHandle, parameters: TakeoffControlFilterParameters):
        self._handle = handle
        self._text_topic = handle.publisher(parameters.filter_state_topic, String, latch=True)
        self._typed_topic = handle.publisher(
            parameters.filter_status_topic, FilterStatus, latch=True
        )
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._status: Status | None = None
        self._text = ""
        self._logged_explanation = ""

    def publish(self, status: Status) -> None:
        """Publish a status if it is another one."""
        if status == self._status:
            return
        self._status = status
        message = stamped(FilterStatus, self._handle.stamp(), **status._asdict())
        message.flight_state = status.flight_state or FlightStatus.UNKNOWN
        self._typed_topic.publish(message)
        explanation = status.takeoff_refusal or status.reason
        text = ": ".join(filter(None, (_words(status), explanation)))
        if text == self._text:
            return
        self._text = text
        self._text_topic.publish(String(text))
        # Once, however the flight state in front of it changes.
        if explanation not in ("", self._logged_explanation):
            self._handle.warn(text)
        self._logged_explanation = explanation

    def publish_diagnostics(self, safe_filter: SafeFilter[object]) -> None:
        """Publish diagnostics."""
        machine = safe_filter.machine
        is_down = machine.state is FilterState.DOWN
        is_acknowledged = safe_filter.choice.remembered is FlightState.ON_GROUND
        if machine.state is FilterState.PASSING or (is_down and is_acknowledged):
            level = diagnostics.OK
        else:
            is_over = machine.state.passes_nothing
            level = diagnostics.ERROR if is_over else diagnostics.WARN
        figures = {
            "takeovers": str(machine.takeovers),
            "hover thrust (m/s^2)": f"{safe_filter.relay.hover:.2f}",
            "age of the commanded control (s)": f"{max(machine.silence, 0.0):.2f}",
        }
        self._diagnostics.publish(diagnostics.report(self._handle, level, self._text, figures))


def _words(status):
    """Return the words of the state, such as "sinking from flying"."""
    words = []
    if status.takeoff_refusal:
        words.append("refusing")
    elif status.state not in (FilterState.PASSING, FilterState.HOLDING):
        words.append(status.state.name.lower())
    if status.flight_state is not None:
        words.append(status.flight_state.word)
    return " from ".join(words) or ("commanded" if status.is_commanded else "unknown")
