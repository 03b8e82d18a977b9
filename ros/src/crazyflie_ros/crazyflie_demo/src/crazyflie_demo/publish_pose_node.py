"""ROS interface of a goal that stays where it is, and of one that is moved by hand."""

from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Joy

from crazyflie_demo.goals import goal_message
from crazyflie_demo.sticks import Sticks
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import FINITE, FRAME, METRES, TOPIC, Integer, Number


class PublishPoseNode(Node):
    """Publish the same goal again and again."""

    def __init__(self):
        super().__init__()
        self._frame = None
        self._topic = None
        self._period = None
        self._goal = None
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._frame = handle.param("worldFrame", FRAME, "world")
        self._topic = handle.param("name", TOPIC, "goal")
        self._period = 1.0 / handle.param("rate", Number("Hz", above=0.0, maximum=500.0), 30.0)
        self._goal = [
            handle.param("x", METRES),
            handle.param("y", METRES),
            handle.param("z", METRES),
            handle.param("yaw", FINITE, 0.0),
        ]

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._topic, PoseStamped)
        handle.timer(self._period, self._on_timer)

    def _on_timer(self):
        self._publisher.publish(goal_message(self._handle.stamp(), self._frame, *self._goal))


_AXES = {"x": 4, "y": 3, "z": 1, "yaw": 0}
_SPEEDS = {"x": 0.5, "y": 0.5, "z": 0.3, "yaw": 1.0}
_SPEED = Number("m/s or rad/s", minimum=0.0)


class PublishPoseTeleopNode(PublishPoseNode):
    """Publish a goal that moves as the sticks are tilted, and stays when they are silent."""

    def __init__(self):
        super().__init__()
        self._joy_topic = None
        self._axes = None
        self._speeds = None
        self._sticks = Sticks()
        self._moved = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        super().load_parameters(handle)
        self._joy_topic = handle.param("joy_topic", TOPIC, "joy")
        self._axes = [
            handle.param(f"axes/{name}", Integer(0, 255), index) for name, index in _AXES.items()
        ]
        self._speeds = [
            handle.param(f"speed/{name}", _SPEED, speed) for name, speed in _SPEEDS.items()
        ]

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._moved = handle.time()
        handle.subscribe(self._joy_topic, Joy, self._on_joy)
        super().register_callbacks(handle)

    def _on_joy(self, message):
        self._sticks.hear(message.axes, self._handle.time())

    def _on_timer(self):
        now = self._handle.time()
        # After a pause, or a reset of the clock, the goal does not jump.
        elapsed = min(max(now - self._moved, 0.0), 2.0 * self._period)
        self._moved = now
        self._goal = [
            value + speed * self._sticks.axis(axis, now) * elapsed
            for value, speed, axis in zip(self._goal, self._speeds, self._axes, strict=True)
        ]
        super()._on_timer()
