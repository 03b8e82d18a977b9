"""ROS interface of flight by hand: sticks to cmd_vel."""

from geometry_msgs.msg import Twist, Vector3
from sensor_msgs.msg import Joy

from crazyflie_demo.sticks import Sticks
from crazyflie_model.limits import FULL_PWM, MAX_SETPOINT_PWM
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC, Integer, Number

_AXES = {"pitch": 4, "roll": 3, "yaw_rate": 0, "thrust": 1}
_RANGES = {
    "pitch": (30.0, Number("deg", above=0.0, maximum=60.0)),
    "roll": (30.0, Number("deg", above=0.0, maximum=60.0)),
    "yaw_rate": (200.0, Number("deg/s", above=0.0)),
    "thrust": (MAX_SETPOINT_PWM, Number("PWM", above=0.0, maximum=FULL_PWM)),
}


class CmdVelTeleopNode(Node):
    """Tilt, turn and lift a vehicle as the sticks are tilted.

    Thrust counts only after its stick has been at zero once. Without a joystick the
    node is silent, and the vehicle's watchdog does the rest.
    """

    def __init__(self):
        super().__init__()
        self._period = None
        self._joy_topic = None
        self._axes = None
        self._ranges = None
        self._sticks = Sticks()
        self._is_locked = True
        self._publisher = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._joy_topic = handle.param("joy_topic", TOPIC, "joy")
        self._period = 1.0 / handle.param("rate", Number("Hz", above=0.0, maximum=500.0), 50.0)
        self._axes = {
            name: handle.param(f"axes/{name}", Integer(0, 255), index)
            for name, index in _AXES.items()
        }
        self._ranges = {
            name: handle.param(f"max/{name}", kind, default)
            for name, (default, kind) in _RANGES.items()
        }

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher("cmd_vel", Twist)
        handle.subscribe(self._joy_topic, Joy, self._on_joy)
        handle.timer(self._period, self._on_timer)

    def _on_joy(self, message):
        self._sticks.hear(message.axes, self._handle.time())

    def _on_timer(self):
        now = self._handle.time()
        if not self._sticks.is_fresh(now):
            if not self._is_locked:
                self._handle.warn(f"nothing comes on {self._joy_topic}: sending no setpoints")
            self._is_locked = True
            return
        pitch, roll, yaw_rate, thrust = (
            self._sticks.axis(self._axes[name], now) * self._ranges[name] for name in _AXES
        )
        if thrust <= 0.0:
            self._is_locked = False
        if self._is_locked:
            thrust = 0.0
        # Sticks are positive to the left, roll and yaw rate of cmd_vel to the right.
        self._publisher.publish(
            Twist(Vector3(pitch, -roll, max(thrust, 0.0)), Vector3(0.0, 0.0, -yaw_rate))
        )
