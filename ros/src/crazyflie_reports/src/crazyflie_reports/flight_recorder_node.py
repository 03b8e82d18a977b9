"""Subscribes to the topics of a flight and keeps their messages."""

import threading
from functools import partial

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
    """Record the topics of a flight; by default those of the examples in its namespace."""

    def __init__(self) -> None:
        self.record = FlightRecord()  #: What has been received so far.
        self.received = threading.Condition()  #: Notified after every message.
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
            callback = partial(self._on_message, getattr(self.record, name), content)
            handle.subscribe(getattr(self._topics, name), message_type, callback)
        handle.subscribe(self._topics.in_flight, Empty, self._on_toggle)

    def stop(self) -> None:
        """Record nothing more."""
        with self.received:
            self._stopped = True

    def _on_message(self, series, content, message):
        row = to_vector(getattr(message, content))
        self._record(series.append, message.header.stamp.to_sec(), row)

    def _on_toggle(self, _):
        self._record(self.record.toggles.append, self._handle.stamp().to_sec())

    def _record(self, append, *values):
        with self.received:
            if not self._stopped:
                append(*values)
                self.received.notify_all()
