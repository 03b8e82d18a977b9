"""Listens to a flight and keeps what it hears."""

import threading

from std_msgs.msg import Empty

from crazyflie_dev.flight_record import FlightRecord
from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC
from crazyflie_utils.runtime.handle import NodeHandle
from crazyflie_utils.vectors import to_vector


class FlightRecorderNode(Node):
    """Record the topics of a flight; by default those of the examples in its namespace.

    Attributes
    ----------
    record : FlightRecord
        What has been heard so far.
    heard : threading.Condition
        Notified after every message.
    """

    def __init__(self):
        super().__init__()
        self.record = FlightRecord()
        self.heard = threading.Condition()
        self._topics = {}
        self._stopped = False

    def load_parameters(self, handle: NodeHandle) -> None:
        """See `Node.load_parameters`."""
        defaults = {
            "state": "state",
            "reference": "ref",
            "takeoff_control": "control/takeoff",
            "final_control": "control/final",
            "in_flight": "in_flight",
        }
        for name, default in defaults.items():
            self._topics[name] = handle.param(f"topics/{name}", TOPIC, default)

    def register_callbacks(self, handle: NodeHandle) -> None:
        """See `Node.register_callbacks`."""
        series = [
            ("state", PositionVelocityYawStateStamped, "state"),
            ("reference", PositionVelocityStateStamped, "state"),
            ("takeoff_control", ControlStamped, "control"),
            ("final_control", ControlStamped, "control"),
        ]
        for name, message_type, content in series:
            callback = self._appender(name, content)
            handle.subscribe(self._topics[name], message_type, callback)
        handle.subscribe(self._topics["in_flight"], Empty, self._on_toggle)

    def stop(self) -> None:
        """Let the record be as it is."""
        with self.heard:
            self._stopped = True

    def _appender(self, name, content):
        series = getattr(self.record, name)

        def append(message):
            with self.heard:
                if self._stopped:
                    return
                self.record.order.append(name)
                series.append(message.header.stamp.to_sec(), to_vector(getattr(message, content)))
                self.heard.notify_all()

        return append

    def _on_toggle(self, message):
        with self.heard:
            if self._stopped:
                return
            self.record.order.append("toggles")
            self.record.toggles.append(self._handle.stamp().to_sec())
            self.heard.notify_all()
