"""ROS interface between references of position and velocity and controllers that need more."""

from functools import partial

from typing_extensions import override

from crazyflie_msgs.msg import (
    FullStateStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import Text

#: Types to which a reference can be converted, by the value of the parameter ``state``.
TYPES = {
    "position_velocity_yaw": PositionVelocityYawStateStamped,
    "full_state": FullStateStamped,
}


class ReferenceConverterParameters(Parameters):
    """Parameters of `ReferenceConverterNode`."""

    reference_topic: str = topic("reference", "where references come from")
    converted_topic: str = topic("converted", "where converted ones go")
    state: str = parameter(
        Text(choices=tuple(TYPES)),
        "converted to PositionVelocityYawStateStamped or FullStateStamped",
    )


class ReferenceConverterNode(Node[ReferenceConverterParameters]):
    """Pass references on as another message; missing fields are zero: level, yaw 0.

    References of a descent, on the topics' names + ``_descent``, are also converted.
    """

    needed_in_flight = True

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._type = TYPES[parameters.state]
        # Latched, since a reference is often sent once, and the controller may start late; a late
        # reference of a descent is useless.
        for suffix, latch in (("", True), ("_descent", False)):
            publisher = handle.publisher(parameters.converted_topic + suffix, self._type, latch)
            handle.subscribe(
                parameters.reference_topic + suffix,
                PositionVelocityStateStamped,
                partial(self._pass_on, publisher),
            )

    def _pass_on(self, publisher, message):
        converted = self._type(header=message.header)
        for field in message.state.__slots__:
            setattr(converted.state, field, getattr(message.state, field))
        publisher.publish(converted)
