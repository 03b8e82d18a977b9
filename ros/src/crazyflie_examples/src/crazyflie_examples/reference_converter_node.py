"""ROS interface between references of position and velocity and controllers that want more."""

from crazyflie_msgs.msg import (
    FullStateStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC, Text

TYPES = {
    "position_velocity_yaw": PositionVelocityYawStateStamped,
    "full_state": FullStateStamped,
}
"""What a reference can be converted to, by what the parameter ``state`` says."""


class ReferenceConverterNode(Node):
    """Pass references on as another message; what they do not have is zero: level, yaw 0."""

    def __init__(self):
        super().__init__()
        self._reference_topic = None
        self._converted_topic = None
        self._type = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._reference_topic = handle.param("topics/reference", TOPIC)
        self._converted_topic = handle.param("topics/converted", TOPIC)
        self._type = TYPES[handle.param("state", Text(choices=tuple(TYPES)))]

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        # A reference is often sent once, and the controller may be late.
        self._publisher = handle.publisher(self._converted_topic, self._type, latch=True)
        handle.subscribe(self._reference_topic, PositionVelocityStateStamped, self._on_reference)

    def _on_reference(self, message):
        converted = self._type(header=message.header)
        for field in message.state.__slots__:
            setattr(converted.state, field, getattr(message.state, field))
        self._publisher.publish(converted)
