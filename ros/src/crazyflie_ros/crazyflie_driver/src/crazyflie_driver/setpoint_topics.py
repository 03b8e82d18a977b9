"""Topics with setpoints and external poses, sent over the link."""

import contextlib
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

from geometry_msgs.msg import Point, PointStamped, PoseStamped, Quaternion, Twist, Vector3
from std_msgs.msg import Empty

from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.monitors import LIFT_LIMIT, MAX_TURN, MIN_CLIMB, LiftWatch
from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.setpoint_gate import GateEvent, SetpointKind
from crazyflie_driver.thrust_fade import FADE_TIME, ThrustFade
from crazyflie_driver.vehicle_base import BaseVehicle
from crazyflie_link.errors import CrazyflieError
from crazyflie_model.limits import LEVEL_AGE, MAX_SETPOINT_PWM, OFF_AGE
from crazyflie_model.supervisor import SupervisorState

CMD_VEL, CMD_STOP = "cmd_vel", "cmd_stop"

_THROTTLE = 1.0
_RATE_WINDOW = 1.0

#: Period of the warning of an estimator that ignores poses, s.
_ESTIMATOR_PERIOD = 30.0

#: Silence after zero thrust that ends a stream, s, and the period of the checks of silence, s.
_REST, _SILENCE_PERIOD = 0.5, 0.1


class Sender(NamedTuple):
    """How the messages of a topic are sent, by ``send(crazyflie, message)``.

    ``height_and_yaw(message)`` returns the height (m) and the yaw (degrees) that a setpoint
    commands; None where it commands none.
    """

    message_type: type
    send: Callable[[Any, Any], None]
    height_and_yaw: Callable[[Any], tuple[float | None, float | None]] = lambda _: (None, None)


class ExternalSender(NamedTuple):
    """The same of a topic with measured positions; ``position(message)`` returns one, m."""

    message_type: type
    send: Callable[[Any, Any], None]
    position: Callable[[Any], tuple[float, float, float]]


def _full_state(crazyflie, message):
    crazyflie.setpoints.full_state(
        _xyz(message.pose.position),
        _xyz(message.twist.linear),
        _xyz(message.acc),
        _xyzw(message.pose.orientation),
        _xyz(message.twist.angular),
    )


def _external_pose(crazyflie, message):
    pose = message.pose
    crazyflie.localization.pose(_xyz(pose.position), _xyzw(pose.orientation))


#: Topic -> how its messages are sent.
SETPOINTS = {
    "cmd_full_state": Sender(
        FullState, _full_state, lambda m: (m.pose.position.z, _yaw(m.pose.orientation))
    ),
    "cmd_velocity_world": Sender(
        VelocityWorld, lambda c, m: c.setpoints.velocity_world(*_xyz(m.vel), m.yawRate)
    ),
    "cmd_hover": Sender(
        Hover,
        lambda c, m: c.setpoints.hover(m.vx, m.vy, m.yawrate, m.zDistance),
        lambda m: (m.zDistance, None),
    ),
    "cmd_position": Sender(
        Position, lambda c, m: c.setpoints.position(m.x, m.y, m.z, m.yaw), lambda m: (m.z, m.yaw)
    ),
}

#: The same of measured positions.
EXTERNAL = {
    "external_position": ExternalSender(
        PointStamped,
        lambda c, m: c.localization.position(*_xyz(m.point)),
        lambda m: _xyz(m.point),
    ),
    "external_pose": ExternalSender(PoseStamped, _external_pose, lambda m: _xyz(m.pose.position)),
}


def _xyz(vector: Point | Vector3) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def _xyzw(orientation: Quaternion) -> tuple[float, float, float, float]:
    return orientation.x, orientation.y, orientation.z, orientation.w


def _thrust(message: Twist) -> float:
    # This order keeps a NaN, which is refused.
    return min(max(message.linear.z, 0.0), MAX_SETPOINT_PWM)


def _yaw(orientation: Quaternion) -> float:
    # For quaternions of any norm.
    x, y, z, w = _xyzw(orientation)
    return math.degrees(math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z))


@dataclass(eq=False)
class SetpointTopics:
    """Subscribe to a vehicle's setpoints and pass them on, as long as that is allowed.

    When messages stop coming, the firmware's watchdogs act, after 0.5 s and 2 s. Before that, a
    stream of thrust that has stopped in flight is followed by level setpoints whose thrust fades:
    the sender may be started again. If the last message stopped the motors, "setpoints stop" is
    sent: otherwise the vehicle would be locked 2 s later.
    """

    _vehicle: BaseVehicle
    _log: LogTopics
    #: The kind of command that the vehicle was sent last.
    control: SetpointKind = SetpointKind.HIGH_LEVEL
    ignored: int = 0  #: Setpoints that were not sent.
    #: When the latest high-level command will have been carried out, s; setpoints until then are
    #: warned of.
    high_level_end: float = -math.inf
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=1000))
    _topic: str = ""
    _external_time: float = -math.inf
    _lift: LiftWatch = field(default_factory=LiftWatch)
    _commanded_yaw: float | None = None
    _fade: ThrustFade = field(default_factory=ThrustFade)
    _faded_time: float = -math.inf
    _end_time: float = -math.inf  # Of the latest notice after zero thrust, s.

    def subscribe(self) -> None:
        """Subscribe to all topics."""
        senders = {
            CMD_VEL: Sender(Twist, lambda _, message: self._cmd_vel(message)),
            CMD_STOP: Sender(Empty, lambda crazyflie, _: crazyflie.setpoints.stop()),
            **SETPOINTS,
        }
        handle, prefix = self._vehicle.handle, self._vehicle.parameters.prefix
        for callback, each in ((self._on_setpoint, senders), (self._on_external, EXTERNAL)):
            for name, sender in each.items():
                receive = partial(callback, name, sender)
                handle.subscribe(f"{prefix}/{name}", sender.message_type, receive)
        self._vehicle.gate.listen(handle.time())
        handle.timer(_SILENCE_PERIOD, self._follow_silence)

    @property
    def is_streaming(self) -> bool:
        """Whether setpoints were sent since the last notice that they stop."""
        return self.control not in (SetpointKind.HIGH_LEVEL, SetpointKind.ENDED)

    @property
    def may_have_priority(self) -> bool:
        """Whether setpoints may keep the vehicle from obeying high-level commands.

        UDP alone does not acknowledge the notice that they stop, which may have been lost; the
        vehicle locks itself once the last setpoint is as old as that.
        """
        return self.is_streaming or self._may_have_lost_notice

    @property
    def _may_have_lost_notice(self):
        may_lose = self._vehicle.crazyflie.address.scheme == "udp"
        return may_lose and self._vehicle.handle.time() - self.last_time < OFF_AGE

    @property
    def runs_motors(self) -> bool:
        """Whether the latest of them runs the motors."""
        return self.control in (SetpointKind.THRUST, SetpointKind.REFERENCE)

    @property
    def is_flown_on_thrust(self) -> bool:
        """Whether the vehicle may fly, on a stream of thrust, which only its sender can land."""
        state = self._log.supervisor
        may_fly = state is None or SupervisorState.FLYING in state
        may_fly = may_fly and not self._vehicle.gate.is_emergency
        is_streamed = self._vehicle.handle.time() - self.last_time < LEVEL_AGE
        return may_fly and is_streamed and self.control is SetpointKind.THRUST

    @property
    def last_time(self) -> float:
        """When the last setpoint was sent, also one of the fade, s; -inf if none was."""
        return max(self._times[-1] if self._times else -math.inf, self._faded_time)

    def rate(self) -> float:
        """Return how many setpoints were sent in the last second."""
        now = self._vehicle.handle.time()
        return sum(1 for time in self._times if now - time <= _RATE_WINDOW) / _RATE_WINDOW

    def can_land_autonomously(self) -> bool:
        """Return whether the vehicle's planner can land it, as far as its inputs show."""
        if self.control is not SetpointKind.THRUST:
            return True
        is_fed = self._vehicle.handle.time() - self._external_time <= _RATE_WINDOW
        return is_fed and not self._log.estimate_problem()

    def send_zero_thrust(self) -> None:
        """Send zero thrust a hundred times, and that setpoints stop; blocks."""
        self._vehicle.crazyflie.setpoints.send_zero_thrust()
        self._setpoints_stopped()

    def open_thrust_lock(self, state: SupervisorState | None) -> None:
        """Send zero thrust to a vehicle whose state, if known, is on the ground; blocks.

        It would take a vehicle out of the air that flies by itself, or that was flying when the
        link was lost.
        """
        if state is None or SupervisorState.FLYING in state:
            self._vehicle.warn(
                "the vehicle may be flying: its thrust stays locked until a setpoint of zero "
                "thrust comes"
            )
        else:
            self.send_zero_thrust()

    def notify_setpoints_stop(self, remain_valid_ms: int = 0) -> None:
        """Announce that setpoints stop, so that the vehicle accepts high-level commands.

        The last setpoint remains valid for some ms.
        """
        self._vehicle.crazyflie.setpoints.notify_setpoints_stop(remain_valid_ms)
        self._setpoints_stopped()

    def was_notified(self, moment: float) -> None:
        """Record that it was announced at a time (s), unless setpoints have come since."""
        if self.last_time <= moment:
            self._setpoints_stopped()

    def _setpoints_stopped(self):
        self.control = SetpointKind.HIGH_LEVEL
        self._lift.end()

    def check_lift(self) -> None:
        """End a stream that commands a flight, while the vehicle stays on the ground.

        The firmware's integrators wind up then, and the vehicle would leap. "Setpoints stop" ends
        that; the stream is then blocked until it has paused.
        """
        log, state = self._log, self._log.supervisor
        is_flying = None if state is None else SupervisorState.FLYING in state
        finding = self._lift.sample(
            self._vehicle.handle.time(), is_flying, log.height, log.vertical_speed
        )
        if finding is None or state is None:
            return
        words = [f"state: {state.words()}"]
        if log.height is not None:
            words.append(f"height {log.height:.2f} m")
        if log.heading is not None:
            words.append(f"yaw {log.heading:.0f} degrees")
        command = f"{self._topic}, {finding.height:.2f} m"
        if self._commanded_yaw is not None:
            command += f", yaw {self._commanded_yaw:.0f} degrees"
        advice = "is it free, do all propellers turn, and is its own yaw commanded?"
        if finding.is_certain:
            self._vehicle.gate.handle(GateEvent.NOT_LIFTED)
            # Without a link, which its state shows, the firmware stops the motors.
            with contextlib.suppress(CrazyflieError):
                self.notify_setpoints_stop()
            advice += " Its motors are stopped, since it might leap; pause the stream to try again"
        self._vehicle.warn(
            f"was commanded to fly ({command}), and has not lifted off within {LIFT_LIMIT:g} s "
            f"({', '.join(words)}): {advice}"
        )

    def _check_heading(self):
        yaw, heading = self._commanded_yaw, self._log.heading
        if yaw is None or heading is None or abs(math.remainder(yaw - heading, 360.0)) <= MAX_TURN:
            return
        self._warn(
            f"{self._topic} commands yaw {yaw:.0f} degrees to a vehicle on the ground with yaw "
            f"{heading:.0f}: it may not lift off, and leap when it turns; command its own yaw "
            "until it flies",
            key="heading",
        )

    def _on_external(self, name, sender, message):
        if self._log.positioning is not None:
            # It may be the vehicle's own estimate, which must not be fed back.
            self._vehicle.warn(
                f"ignoring {name}: its positioning is {self._log.positioning.source}", 5.0, name
            )
            return
        now, position = self._vehicle.handle.time(), sender.position(message)
        if jump := self._log.agreement.jump(now, position, self._log.is_flying):
            self._warn(
                f"ignoring {name}: it jumps by {jump:.2f} m in flight; is it that of another body?",
                "jump",
            )
            return
        self._external_time = now
        if self._send(name, sender, message):
            self._log.agreement.pose(now, position)
            if problem := self._log.estimator_problem():
                self._vehicle.warn(f"{name}: {problem}", _ESTIMATOR_PERIOD, "estimator")

    def _on_setpoint(self, name, sender, message):
        now, gate = self._vehicle.handle.time(), self._vehicle.gate
        at_rest = name == CMD_STOP or (name == CMD_VEL and message.linear.z <= 0.0)
        moving = SetpointKind.THRUST if name == CMD_VEL else SetpointKind.REFERENCE
        control = SetpointKind.ZERO_THRUST if at_rest else moving
        height, yaw = sender.height_and_yaw(message)
        if height is not None and height < MIN_CLIMB:
            gate.handle(GateEvent.GROUND_COMMANDED)
        refusal = gate.refusal(now, control)
        key = "gate" if refusal else "estimate"
        refusal = refusal or self._wrong_estimate(name)
        is_sent = not refusal and self._send(name, sender, message)
        if is_sent:
            if name == CMD_STOP:
                gate.stop(now)
            self._times.append(now)
            if name == CMD_VEL:
                self._fade.command(now, _thrust(message))
            self.control, self._topic = control, name
        if refusal:
            self._warn(f"ignoring {name}: {refusal}", key=key)
        if not is_sent:
            self.ignored += 1
            return
        self._commanded_yaw = yaw
        if self._lift.command(now, height):
            self._check_heading()
        if now < self.high_level_end:
            self._warn(f"{name} overrides the high-level command", key="override")

    def _wrong_estimate(self, name):
        # Returns why a setpoint would lead the vehicle elsewhere. A flight by such setpoints goes
        # on: without them the vehicle would fall.
        problem = self._log.estimate_problem() if name in SETPOINTS else ""
        if problem and self.control is SetpointKind.REFERENCE and self._log.is_flying:
            self._warn(f"{name} in flight: {problem}", key="estimate")
            return ""
        return problem

    def _send(self, name, sender, message):
        try:
            sender.send(self._vehicle.crazyflie, message)
        except CrazyflieError as error:
            self._warn(f"ignoring {name}: {error}", key=name)
            return False
        return True

    def _follow_silence(self):
        now = self._vehicle.handle.time()
        # Without a link, which its state shows; it is tried again.
        with contextlib.suppress(CrazyflieError):
            if self.control is SetpointKind.ZERO_THRUST and now - self.last_time > _REST:
                self.notify_setpoints_stop()
                self.control, self._end_time = SetpointKind.ENDED, now
            elif self.control is SetpointKind.ENDED and self._may_have_lost_notice:
                self._repeat_notice(now)
            elif self.control is SetpointKind.THRUST and self._log.is_flying:
                self._send_fading(now)

    def _repeat_notice(self, now):
        # A vehicle that has lost it would be locked.
        is_refused = self._vehicle.gate.refusal_of_repetition(now)
        if not is_refused and now - self._end_time >= _REST:
            self._vehicle.crazyflie.setpoints.notify_setpoints_stop()
            self._end_time = now

    def _send_fading(self, now):
        thrust = self._fade.thrust(now)
        if thrust is None or self._vehicle.gate.refusal_of_repetition(now):
            return
        self._cmd_vel(Twist(linear=Vector3(z=thrust)))
        self._faded_time = now
        self._vehicle.warn(
            f"{CMD_VEL} has stopped in flight: the vehicle is kept level with a thrust that fades "
            f"for {FADE_TIME:g} s; {OFF_AGE:g} s later it stops its motors",
            OFF_AGE,
            "fade",
        )

    def _warn(self, text, key):
        self._vehicle.warn(text, _THROTTLE, key)

    def _cmd_vel(self, message):
        # The link's pitch is the negative of cmd_vel's, and cflib negates it; tests compare bytes.
        thrust = _thrust(message)
        parameters, state = self._vehicle.parameters, self._log.supervisor
        if thrust > 0.0 and state is not None:
            if state.faults & ~SupervisorState.TUMBLED:
                self._warn(f"cannot fly ({state.words()}): {state.remedy}", key="locked")
            elif SupervisorState.ARMED not in state:
                self._warn(f"not armed, call {parameters.prefix}/arm", key="armed")
        self._vehicle.crazyflie.setpoints.attitude(
            message.linear.y + parameters.roll_trim,
            message.linear.x + parameters.pitch_trim,
            message.angular.z,
            thrust,
        )
