"""The node: a subscriber that says when to begin, a timer that publishes references."""

from typing_extensions import override

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle
from eight_by_reference.eight import Eight

TIME_STEP = 0.05

# Step 1: on which topic does the vehicle take positions, and of which type is it? Inspect the
# running flight, then fill in the names.
TOPIC = ""
TYPE = ""
"""Package and type, as rostopic gives them."""


class EightNode(Node):
    """Publish references while the vehicle flies, from where it is then."""

    def __init__(self) -> None:
        self._position: tuple[float, float, float] | None = None
        self._eight: Eight | None = None
        self._beginning = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """There are no parameters."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        # Step 4: a publisher of TOPIC, and a timer that publishes position and velocity every
        # TIME_STEP, with the stamp handle.stamp().
        handle.subscribe("state", PositionVelocityYawStateStamped, self._on_state, finite="state")
        handle.subscribe("in_flight_flight_status", FlightStatus, self._on_flight_status)

    def _on_state(self, message):
        self._position = (message.state.x, message.state.y, message.state.z)

    def _on_flight_status(self, message):
        if message.state != FlightStatus.FLYING:
            self._eight = None
        elif self._eight is None and self._position is not None:
            self._eight, self._beginning = Eight(self._position), self._handle.time()
