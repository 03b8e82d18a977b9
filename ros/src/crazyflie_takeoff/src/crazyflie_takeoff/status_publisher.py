"""What the takeoff server publishes and logs of a flight, beside controls and references."""

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from crazyflie_msgs.msg import FlightStatus
from crazyflie_takeoff import diagnostics
from crazyflie_takeoff.flight import REFUSALS, FlightStateMachine
from crazyflie_takeoff.flight_state import FlightState, flight_state
from crazyflie_takeoff.server_states import TAKEOVERS, Event
from crazyflie_takeoff.takeoff_checks import TakeoffChecks
from crazyflie_takeoff.takeoff_server_parameters import TakeoffServerParameters
from crazyflie_utils import NodeHandle
from crazyflie_utils.vectors import stamped

#: For an operator both parts of a landing are one.
_LOG_WORDS = {
    FlightState.ON_GROUND: "on the ground",
    FlightState.TAKING_OFF: "taking off",
    FlightState.FLYING: "flying",
    FlightState.DESCENDING: "landing",
    FlightState.LANDING: "landing",
}


class StatusPublisher:
    """Publishes and logs the state of a flight when it changes."""

    def __init__(
        self,
        handle: NodeHandle,
        parameters: TakeoffServerParameters,
        flight: FlightStateMachine,
        checks: TakeoffChecks,
    ):
        self._handle, self._flight, self._checks = handle, flight, checks
        self._state = handle.publisher(parameters.flight_state_topic, String, latch=True)
        self._status = handle.publisher(parameters.flight_status_topic, FlightStatus, latch=True)
        self._text = handle.publisher(parameters.status_topic, String, latch=True)
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._inhibit_shutdown = handle.inhibit_shutdown()
        self.state: FlightState | None = None  # The one that was published last.
        self.reason = ""  # Why the last landing or abort began.
        self._published: tuple[object, ...] = ()
        self._published_text = ""
        self._logged_word = self._logged_reason = ""

    def takeoff_refusal(self) -> str:
        """Return why the vehicle must not take off from the ground; empty if it may."""
        return self._checks.refusal(self._handle.time(), self._flight.filter)

    def log_recovery(self, height: float | None) -> None:
        """Log the state in which the server begins and the evidence; height above ground in m."""
        report, state = self._flight.filter, self._flight.flight_state
        if state is None:
            return
        if report.event is Event.FILTER_SINKS:
            evidence = "the filter brings the vehicle down"
        elif report.event in TAKEOVERS:
            evidence = "the filter has stopped the motors"
        else:
            remembered = "nothing" if report.remembered is None else report.remembered.word
            seen = "not known" if height is None else f"{height:.2f} m"
            evidence = f"{remembered} is remembered, the height is {seen}"
        self._handle.info(f"begins {state.word}: {evidence}")
        self._logged_word = _LOG_WORDS[state]

    def publish_state(self, state: FlightState) -> None:
        """Publish another state; log it, with the reason if there is a new one."""
        self.state = state
        # The filter logs its own reasons.
        reason = "" if self.reason == self._flight.filter.reason else self.reason
        if (word := _LOG_WORDS[state]) != self._logged_word:
            is_new = reason and reason != self._logged_reason
            self._handle.info(f"{word}: {reason}" if is_new else word)
            self._logged_word, self._logged_reason = word, reason
        self._state.publish(String(state.word))
        self._inhibit_shutdown(state is not FlightState.ON_GROUND)
        self.publish()

    def publish(self) -> None:
        """Publish the status, typed and in words, if it has changed."""
        status = self._flight_status()
        content = (status.state, status.reason, status.takeoff_refusal)
        # Not before the state's own topics, and nothing while it is not known.
        if content != self._published and status.state == self.state:
            self._published = content
            self._status.publish(status)
        if (text := _text(status)) != self._published_text:
            self._published_text = text
            self._text.publish(String(text))

    def publish_diagnostics(self) -> None:
        """Publish the status with figures."""
        checks, event = self._checks, self._flight.filter.event
        text = _text(self._flight_status())
        level = diagnostics.WARN if ": " in text else diagnostics.OK
        if event in (Event.FILTER_SINKS, Event.FILTER_EMERGENCY):
            level = diagnostics.ERROR
        figures = {
            "state is fresh": str(checks.position.value(self._handle.time()) is not None),
            "controller": str(checks.has_controller),
            "battery (V)": f"{checks.battery.voltage:.2f}",
        }
        self._diagnostics.publish(diagnostics.report(self._handle, level, text, figures))

    def _flight_status(self):
        state, report = self._flight.flight_state, self._flight.filter
        may_refuse = state is FlightState.ON_GROUND
        is_held = report.event is Event.FILTER_HOLDS and state not in (None, FlightState.ON_GROUND)
        reasons = (self.reason, report.reason if is_held else "")
        return stamped(
            FlightStatus,
            self._handle.stamp(),
            state=state or FlightStatus.UNKNOWN,
            reason="; ".join(filter(None, reasons)),
            takeoff_refusal=self.takeoff_refusal() if may_refuse else REFUSALS[state],
            ground=self._flight.ground,
        )


def _text(status):
    state, reasons = flight_state(status.state), [status.reason] if status.reason else []
    words = "looking for the state of the flight" if state is None else state.word.replace("_", " ")
    if state is FlightState.ON_GROUND and status.takeoff_refusal:
        reasons.append(f"takeoff refused: {status.takeoff_refusal}")
    return ": ".join(filter(None, (words, "; ".join(reasons))))
