"""Topics with setpoints and external poses, turned into what goes over the link."""

import contextlib
import math
from collections import deque
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point, PointStamped, PoseStamped, Quaternion, Twist, Vector3
from std_msgs.msg import Empty

from crazyflie_driver.lift_watch import LIMIT, LiftWatch
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.setpoint_gate import SetpointGate
from crazyflie_driver.vehicle_parameters import VehicleParameters
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import CrazyflieError
from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle

CMD_VEL, CMD_STOP = "cmd_vel", "cmd_stop"

_HEIGHT_AND_YAW: dict[str, Callable[[Any], tuple[float, float | None]]] = {
    "cmd_full_state": lambda message: (message.pose.position.z, _yaw(message.pose.orientation)),
    "cmd_hover": lambda message: (message.zDistance, None),
    "cmd_position": lambda message: (message.z, message.yaw),
}
"""Topic -> height (m) and yaw (degrees) that its setpoints ask for; the others ask for none."""

_THROTTLE = 1.0
_RATE_WINDOW = 1.0

_REST, _REST_PERIOD = 0.5, 0.1
"""After zero thrust, silence of so long is the end of a stream, s; how often that is looked at."""


class SetpointTopics:
    """Subscribe to a vehicle's setpoints and pass them on, as long as that is allowed.

    Nothing is repeated or made up: when messages stop coming, the firmware's own
    watchdogs act, after 0.5 s and 2 s. But when the last one had the motors stand still, the
    vehicle is told that setpoints end: otherwise it would be locked 2 s later.

    Parameters
    ----------
    handle : NodeHandle
    parameters : VehicleParameters
    crazyflie : crazyflie_link.Crazyflie
    log : LogTopics
        Knows whether the vehicle is armed, and where it is.

    Attributes
    ----------
    gate : SetpointGate
        Whether setpoints are passed on.
    is_streaming : bool
        Whether setpoints were sent since the last hand-over to high-level commands.
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
        self.gate = SetpointGate()
        self.is_streaming = False
        self.ignored = 0
        self._handle = handle
        self._parameters = parameters
        self._crazyflie = crazyflie
        self._log = log
        self._times: deque[float] = deque(maxlen=1000)
        self._high_level_end: float | None = None
        self._is_at_rest = False
        self._source = ""
        self._external_time: float | None = None
        self._lift = LiftWatch()
        self._told_yaw: float | None = None

    def subscribe(self) -> None:
        """Begin to listen."""
        setpoints = self._crazyflie.setpoints
        for name, message_type, send in (
            (CMD_VEL, Twist, self._cmd_vel),
            ("cmd_full_state", FullState, self._full_state),
            ("cmd_velocity_world", VelocityWorld, self._velocity_world),
            ("cmd_hover", Hover, self._hover),
            ("cmd_position", Position, self._position),
            (CMD_STOP, Empty, lambda _: setpoints.stop()),
        ):
            self._subscribe(name, message_type, self._setpoint(name, send))
        for name, message_type, send in (
            ("external_position", PointStamped, self._external_position),
            ("external_pose", PoseStamped, self._external_pose),
        ):
            self._subscribe(name, message_type, self._guarded(name, send))
        self._handle.timer(_REST_PERIOD, self._end_stream_at_rest)

    def rate(self, now: float) -> float:
        """Return how many setpoints were sent in the last second."""
        return sum(1 for time in self._times if now - time <= _RATE_WINDOW) / _RATE_WINDOW

    def send_zero_thrust(self) -> None:
        """Send zero thrust a hundred times, and that setpoints end; blocks."""
        self._crazyflie.setpoints.send_zero_thrust()
        self.is_streaming = False
        self._lift.end()

    @property
    def last_time(self) -> float:
        """When the last setpoint was sent, s; -inf if none was."""
        return self._times[-1] if self._times else -math.inf

    def notify_setpoints_stop_now(self, remain_valid_ms: int = 0) -> None:
        """Do the same as `hand_over`, in the thread that sends: see crazyflie_link's `guarded`."""
        self._crazyflie.setpoints.notify_setpoints_stop_now(remain_valid_ms)
        self.is_streaming = False
        self._lift.end()

    def notify_setpoints_stop(self, remain_valid_ms: int = 0) -> None:
        """Announce that setpoints end, so that the vehicle accepts high-level commands."""
        self._crazyflie.setpoints.notify_setpoints_stop(remain_valid_ms)
        self.is_streaming = False
        self._lift.end()

    def check_lift(self) -> None:
        """End a stream that has the vehicle fly, while it stays on the ground.

        The firmware's integrators wind up then, and the vehicle would leap. "Setpoints stop" ends
        that; what is streamed then is blocked until it has paused.
        """
        log, state = self._log, self._log.supervisor
        is_flying = None if state is None else SupervisorState.FLYING in state
        finding = self._lift.sample(self._handle.time(), is_flying, log.height, log.vertical_speed)
        if finding is None or state is None:
            return
        words = [f"state: {state.words()}"]
        if log.height is not None:
            words.append(f"height {log.height:.2f} m")
        if log.heading is not None:
            words.append(f"yaw {log.heading:.0f} degrees")
        told = f"{self._source}, {finding.height:.2f} m"
        if self._told_yaw is not None:
            told += f", yaw {self._told_yaw:.0f} degrees"
        advice = "is it free, do all propellers turn, and is it told its own yaw?"
        if finding.is_certain:
            self.gate.not_lifted()
            # Without a link, which is said by its state, the firmware stops the motors.
            with contextlib.suppress(CrazyflieError):
                self.notify_setpoints_stop()
            advice += " Its motors are stopped, since it might leap; pause the stream to try again"
        self._handle.warn(
            f"{self._parameters.name}: was told to fly ({told}), and has not lifted off within "
            f"{LIMIT:g} s ({', '.join(words)}): {advice}"
        )

    def knows_position(self, now: float) -> bool:
        """Return whether the vehicle's planner can land it, as far as its inputs tell."""
        fed = self._external_time is not None and now - self._external_time <= _RATE_WINDOW
        return fed or not (self.is_streaming and self._source == CMD_VEL)

    @property
    def is_flight(self) -> bool:
        """Whether setpoints since the last hand-over had the motors run."""
        return self.is_streaming and not self._is_at_rest

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
            now = self._handle.time()
            at_rest = name == CMD_STOP or (name == CMD_VEL and message.linear.z <= 0.0)
            with self.gate.passing(now, at_rest) as refusal:
                is_sent = not refusal and send(message)
                if is_sent:
                    if name == CMD_STOP:
                        self.gate.stop(now)
                    self._times.append(now)
                    self.is_streaming, self._is_at_rest, self._source = True, at_rest, name
            if refusal:
                self._warn(f"ignoring {name}: {refusal}", key="gate")
            if not is_sent:
                self.ignored += 1
                return
            height, self._told_yaw = _HEIGHT_AND_YAW.get(name, _nothing)(message)
            self._lift.command(now, height)
            if self._high_level_end is not None and now < self._high_level_end:
                self._warn(f"{name} overrides the high-level command", key="override")

        return callback

    def _end_stream_at_rest(self):
        if not (self.is_streaming and self._is_at_rest):
            return
        if self._handle.time() - self._times[-1] > _REST:
            # Without a link, which is said by its state; it is tried again.
            with contextlib.suppress(CrazyflieError):
                self.notify_setpoints_stop()

    def _warn(self, text, key):
        name = self._parameters.name
        self._handle.warn(f"{name}: {text}", throttle=_THROTTLE, key=(name, key))

    # One message each. Signs: the link's pitch is the negative of cmd_vel's, and
    # crazyflie_link (cflib) negates it; the tests compare bytes.

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
        self._external_time = self._handle.time()
        self._crazyflie.localization.position(*_xyz(message.point))

    def _external_pose(self, message):
        self._external_time = self._handle.time()
        orientation = message.pose.orientation
        self._crazyflie.localization.pose(
            _xyz(message.pose.position),
            (orientation.x, orientation.y, orientation.z, orientation.w),
        )


def _yaw(orientation: Quaternion) -> float:
    # For quaternions of any norm.
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    return math.degrees(math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))


def _nothing(_: object) -> tuple[None, None]:
    return None, None


def _xyz(vector: Point | Vector3) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z
