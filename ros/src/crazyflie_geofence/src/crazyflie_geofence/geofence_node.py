"""ROS interface of the geofence."""

from crazyflie_geofence.geofence import (
    MAX_HORIZONTAL_BRAKING,
    MAX_VERTICAL_BRAKING,
    Braking,
    Geofence,
)
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawStateStamped,
    PrioritizedControl,
    PrioritizedControlStamped,
)
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import METRES, TIME_STEP, TOPIC, Number
from crazyflie_utils.parameters import ParameterError
from crazyflie_utils.vectors import from_vector, is_finite, to_vector

_RATE = Number(unit="1/s", above=0.0)


class GeofenceNode(Node):
    """Answer every state with a prioritised control that keeps the vehicle in a box.

    Silent until there is a regular control: without one, the merger is silent too.
    """

    def __init__(self):
        super().__init__()
        self._state_topic = None
        self._control_topic = None
        self._prioritized_topic = None
        self._fence = None
        self._regular = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._state_topic = handle.param("topics/state", TOPIC)
        self._control_topic = handle.param("topics/control", TOPIC)
        self._prioritized_topic = handle.param("topics/prioritized_control", TOPIC)
        margin = handle.param("margin", Number(unit="m", above=0.0), 0.5)
        lower = [handle.param(f"box/min/{axis}", METRES) for axis in "xyz"]
        upper = [handle.param(f"box/max/{axis}", METRES) for axis in "xyz"]
        for axis, low, high in zip("xyz", lower, upper, strict=True):
            if high - low < 2.0 * margin:
                raise ParameterError(
                    f"parameter {handle.resolve(f'~box/max/{axis}')} is {high}; expected at "
                    f"least {low + 2.0 * margin:g} m, which is box/min/{axis} and twice the margin"
                )
        self._fence = Geofence(
            lower,
            upper,
            margin,
            _braking(handle, "horizontal", MAX_HORIZONTAL_BRAKING, 1.5, 0.4),
            _braking(handle, "vertical", MAX_VERTICAL_BRAKING, 4.0, 0.2),
            handle.param("recovery_rate", _RATE, 1.0),
        )

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._prioritized_topic, PrioritizedControlStamped)
        handle.subscribe(self._control_topic, ControlStamped, self._on_control)
        handle.subscribe(self._state_topic, PositionVelocityYawStateStamped, self._on_state)

    def _on_control(self, message):
        if is_finite(message.control):
            self._regular = to_vector(message.control)
        else:
            self._warn_not_finite("a control", self._control_topic)

    def _on_state(self, message):
        if not is_finite(message.state):
            self._warn_not_finite("a state", self._state_topic)
            return
        if self._regular is None:
            return
        x = to_vector(message.state)
        u, priority = self._fence.control(x[:3], x[3:6], x[6], self._regular)
        prioritized = PrioritizedControlStamped(
            control=PrioritizedControl(from_vector(Control, u), priority)
        )
        prioritized.header.stamp = message.header.stamp
        self._publisher.publish(prioritized)

    def _warn_not_finite(self, what, topic):
        self._handle.warn(f"ignoring {what} on {topic} that is not finite", throttle=1.0)


def _braking(handle, direction, most, deceleration, reaction_time):
    kind = Number(unit="m/s^2", above=0.0, maximum=most)
    return Braking(
        handle.param(f"braking/{direction}", kind, deceleration),
        handle.param(f"reaction_time/{direction}", TIME_STEP, reaction_time),
    )
