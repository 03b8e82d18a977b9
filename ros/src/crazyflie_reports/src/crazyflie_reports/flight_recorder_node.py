"""Subscribes to the topics of a flight and keeps their messages."""

import threading

from std_msgs.msg import Empty
from typing_extensions import override

from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_reports.flight_record import FlightRecord
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC
from crazyflie_utils.vectors import to_vector


class FlightRecorderParameters(Parameters):
    """Parameters of `FlightRecorderNode`: relative names are in its namespace."""

    state: str = parameter(TOPIC, "estimated states", "state", "topics/state")
    reference: str = parameter(TOPIC, "references", "ref", "topics/reference")
    takeoff_control: str = parameter(
        TOPIC, "the takeoff server's controls", "control/takeoff", "topics/takeoff_control"
    )
    final_control: str = parameter(
        TOPIC, "the vehicle's controls", "control/final", "topics/final_control"
    )
    in_flight: str = parameter(
        TOPIC, "toggles between ground and flight", "in_flight", "topics/in_flight"
    )


class FlightRecorderNode(Node):
    """Record the topics of a flight; by default those of the examples in its namespace.

    Attributes
    ----------
    record : FlightRecord
        What has been received so far.
    received : threading.Condition
        Notified after every message.
    """

    def __init__(self) -> None:
        self.record = FlightRecord()
        self.received = threading.Condition()
        self._stopped = False

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._topics = handle.load(FlightRecorderParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        series = [
            ("state", PositionVelocityYawStateStamped, "state"),
            ("reference", PositionVelocityStateStamped, "state"),
            ("takeoff_control", ControlStamped, "control"),
            ("final_control", ControlStamped, "control"),
        ]
        for name, message_type, content in series:
            callback = self._appender(name, content)
            handle.subscribe(getattr(self._topics, name), message_type, callback)
        handle.subscribe(self._topics.in_flight, Empty, self._on_toggle)

    def stop(self) -> None:
        """Let the record be as it is."""
        with self.received:
            self._stopped = True

    def _appender(self, name, content):
        series = getattr(self.record, name)

        def append(message):
            row = to_vector(getattr(message, content))
            self._record(lambda: series.append(message.header.stamp.to_sec(), row))

        return append

    def _on_toggle(self, _):
        now = self._handle.stamp().to_sec()
        self._record(lambda: self.record.toggles.append(now))

    def _record(self, append):
        with self.received:
            if self._stopped:
                return
            append()
            self.received.notify_all()
