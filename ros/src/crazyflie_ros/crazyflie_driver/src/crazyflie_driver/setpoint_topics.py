"""Topics with setpoints and external poses, turned into what goes over the link."""

from collections import deque

from geometry_msgs.msg import Point, PointStamped, PoseStamped, Twist, Vector3
from std_msgs.msg import Empty

from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_model.supervisor import SupervisorState
from crazyflie_py.crazyflie import Crazyflie
from crazyflie_py.errors import CrazyflieError
from crazyflie_utils import NodeHandle

_THROTTLE = 1.0
_RATE_WINDOW = 1.0


class SetpointTopics:
    """Subscribe to a vehicle's setpoints and pass them on, as long as that is allowed.

    Nothing is repeated or made up: when messages stop coming, the firmware's own
    watchdogs act, after 0.5 s and 2 s.

    Parameters
    ----------
    handle : NodeHandle
    parameters : VehicleParameters
    crazyflie : crazyflie_py.Crazyflie
    log : LogTopics
        Knows whether the vehicle is armed.

    Attributes
    ----------
    is_blocked : bool
        Whether setpoints are ignored: after an emergency stop.
    is_streaming : bool
        Whether setpoints have come since the last hand-over to high-level commands.
    ignored : int
        Setpoints that were not sent.
    """

    def __init__(
        self,
        handle: NodeHandle,
        parameters: VehicleParameters,
        crazyflie: Crazyflie,
        log: LogTopics,
    ):
        self.is_blocked = False
        self.is_streaming = False
        self.ignored = 0
        self._handle = handle
        self._parameters = parameters
        self._crazyflie = crazyflie
        self._log = log
        self._times: deque[float] = deque(maxlen=1000)
        self._high_level_end: float | None = None

    def subscribe(self) -> None:
        """Begin to listen."""
        setpoints = self._crazyflie.setpoints
        for name, message_type, send in (
            ("cmd_vel", Twist, self._cmd_vel),
            ("cmd_full_state", FullState, self._full_state),
            ("cmd_velocity_world", VelocityWorld, self._velocity_world),
            ("cmd_hover", Hover, self._hover),
            ("cmd_position", Position, self._position),
            ("cmd_stop", Empty, lambda _: setpoints.stop()),
        ):
            self._subscribe(name, message_type, self._setpoint(name, send))
        for name, message_type, send in (
            ("external_position", PointStamped, self._external_position),
            ("external_pose", PoseStamped, self._external_pose),
        ):
            self._subscribe(name, message_type, self._guarded(name, send))

    def rate(self, now: float) -> float:
        """Return how many setpoints were sent in the last second."""
        return sum(1 for time in self._times if now - time <= _RATE_WINDOW) / _RATE_WINDOW

    def zeros(self) -> None:
        """Send zero thrust a hundred times; blocks.

        They, too, keep the vehicle from accepting high-level commands.
        """
        self.is_streaming = True
        self._crazyflie.setpoints.zeros()

    def hand_over(self, remain_valid_ms: int = 0) -> None:
        """Announce that setpoints end, so that the vehicle accepts high-level commands."""
        self._crazyflie.setpoints.hand_over(remain_valid_ms)
        self.is_streaming = False

    def high_level_until(self, moment: float) -> None:
        """Take note that a high-level command is carried out until a moment (s)."""
        self._high_level_end = moment

    def _subscribe(self, name, message_type, callback):
        self._handle.subscribe(f"{self._parameters.prefix}/{name}", message_type, callback)

    def _guarded(self, name, send):
        def callback(message):
            try:
                send(message)
            except CrazyflieError as error:
                self._warn(f"ignoring {name}: {error}", key=name)
                return False
            return True

        return callback

    def _setpoint(self, name, send):
        send = self._guarded(name, send)

        def callback(message):
            if self.is_blocked:
                self.ignored += 1
                self._warn(f"ignoring {name}: emergency stop", key="emergency")
                return
            if not send(message):
                self.ignored += 1
                return
            now = self._handle.time()
            self._times.append(now)
            self.is_streaming = True
            if self._high_level_end is not None and now < self._high_level_end:
                self._warn(f"{name} overrides the high-level command", key="override")

        return callback

    def _warn(self, text, key):
        name = self._parameters.name
        self._handle.warn(f"{name}: {text}", throttle=_THROTTLE, key=(name, key))

    # One message each. Signs: the link's pitch is the negative of cmd_vel's, and
    # crazyflie_py (cflib) negates it; the tests compare bytes.

    def _cmd_vel(self, message):
        # In this order a NaN stays one, and is refused.
        thrust = min(max(message.linear.z, 0.0), MAX_SETPOINT_PWM)
        state = self._log.supervisor
        if thrust > 0.0 and state is not None:
            if state & (SupervisorState.LOCKED | SupervisorState.CRASHED):
                self._warn(f"cannot fly ({state.words()}): restart the vehicle", key="locked")
            elif SupervisorState.ARMED not in state:
                self._warn(f"not armed, call {self._parameters.prefix}/arm", key="armed")
        self._crazyflie.setpoints.attitude(
            message.linear.y + self._parameters.roll_trim,
            message.linear.x + self._parameters.pitch_trim,
            message.angular.z,
            thrust,
        )

    def _full_state(self, message):
        orientation, rates = message.pose.orientation, message.twist.angular
        self._crazyflie.setpoints.full_state(
            _xyz(message.pose.position),
            _xyz(message.twist.linear),
            _xyz(message.acc),
            (orientation.x, orientation.y, orientation.z, orientation.w),
            _xyz(rates),
        )

    def _velocity_world(self, message):
        self._crazyflie.setpoints.velocity_world(*_xyz(message.vel), message.yawRate)

    def _hover(self, message):
        self._crazyflie.setpoints.hover(message.vx, message.vy, message.yawrate, message.zDistance)

    def _position(self, message):
        self._crazyflie.setpoints.position(message.x, message.y, message.z, message.yaw)

    def _external_position(self, message):
        self._crazyflie.localization.position(*_xyz(message.point))

    def _external_pose(self, message):
        orientation = message.pose.orientation
        self._crazyflie.localization.pose(
            _xyz(message.pose.position),
            (orientation.x, orientation.y, orientation.z, orientation.w),
        )


def _xyz(vector: Point | Vector3) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z
