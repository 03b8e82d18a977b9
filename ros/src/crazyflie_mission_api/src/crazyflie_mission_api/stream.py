"""Setpoints: single ones, and those along a trajectory with the command that takes over."""

import math
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Empty

from crazyflie_driver.msg import FullState, Hover, Position, VelocityWorld
from crazyflie_driver.setpoint_gate import OVERLAP
from crazyflie_fleet.high_level_services import full_state_message
from crazyflie_mission_api.mission_vehicle import (
    AttitudeSetpoint,
    FullStateSetpoint,
    HoverSetpoint,
    PositionSetpoint,
    Setpoint,
    VelocityWorldSetpoint,
    done,
)
from crazyflie_mission_api.trajectories import TimedTrajectory
from crazyflie_model.polynomials import Goal
from crazyflie_model.trajectory import Pieces
from crazyflie_utils import NodeHandle, ServiceError
from crazyflie_utils.steps import follow
from crazyflie_utils.topics import Publisher

STEP = 0.02  #: Period of the setpoints (s).

#: Longest time until a command is accepted (s); otherwise it is sent again. From `OVERLAP` after a
#: command, the driver passes setpoints on again, which override the command.
MAX_ANSWER_TIME = OVERLAP / 2.0

RETRY_PERIOD = 1.0  #: Time from a failed command to the next try (s).

#: Timeout of the connection before the first setpoint (s of the machine's clock).
_CONNECTION_LIMIT = 2.0

Send = Callable[[], "Future[Any]"]


class SetpointStream:
    """Full-state setpoints along a trajectory, then at rest at its end.

    Setpoints have priority over the firmware's high-level commander, which they stop; without any,
    the firmware levels out after 0.5 s and stops the motors after 2 s. So they go on until the
    driver has accepted a command; at the end of the trajectory that is ``hold``'s.

    Commands are sent one after the other. All methods may be called from any thread. The setpoints,
    in a frame, go to the driver's topic of crazyflie_driver/FullState; ``hold(goal)`` commands the
    vehicle to stay at a `Goal`, and returns the answer's future.
    """

    def __init__(
        self,
        handle: NodeHandle,
        topic: str,
        frame: str,
        hold: Callable[[Goal[float]], "Future[Any]"],
    ):
        self._handle = handle
        self._frame = frame
        self._hold = hold
        self._trajectory: TimedTrajectory | None = None
        self._last_turn: Future[None] = done(None)
        self._next_hold = 0.0
        #: Why ``hold`` has failed at the end of a trajectory; empty if it has not.
        self.fault = ""
        self._publisher = handle.publisher(topic, FullState)
        handle.timer(STEP, self._on_timer)

    @property
    def is_active(self) -> bool:
        """Whether there are setpoints."""
        return self._trajectory is not None

    def start(self, pieces: Pieces) -> "Future[Any]":
        """Stream a trajectory from now on, instead of the present one."""
        return follow(self._in_turn(self._begin(pieces)), self._handle.submit)

    def hand_over(self, send: Send, retry_time: float = 0.0) -> "Future[Any]":
        """Send a command; setpoints end when it has been accepted. Return the last answer.

        ``send()`` returns the future of an answer. A command that fails while there are setpoints
        is sent again for ``retry_time``, s.
        """
        steps = self._take_over(send, self._handle.time() + retry_time)
        return follow(self._in_turn(steps), self._handle.submit)

    def stop(self) -> None:
        """End the setpoints at once, without a command that takes over."""
        self._trajectory = None

    def _in_turn(self, steps):
        """Do steps when those before them have ended."""
        # All that follows is done by the executor of the node.
        yield done(None)
        before = self._last_turn
        turn: Future[None] = Future()
        self._last_turn = turn
        yield before
        try:
            return (yield from steps)
        finally:
            turn.set_result(None)

    def _begin(self, pieces):
        self.fault = ""
        self._trajectory = TimedTrajectory(pieces, self._handle.time())
        yield from ()

    def _take_over(self, send, retry_end):
        while True:
            sent_time = self._handle.time()
            try:
                answer = yield send()
            except ServiceError:
                if not self.is_active or self._handle.time() >= retry_end:
                    raise
                yield self._pause()
            else:
                if not self.is_active or self._handle.time() - sent_time <= MAX_ANSWER_TIME:
                    break
        self.fault = ""
        self.stop()
        return answer

    def _pause(self):
        end: Future[None] = Future()
        timer = self._handle.timer(RETRY_PERIOD, lambda: end.set_result(None))
        end.add_done_callback(lambda _: timer.stop())
        return end

    def _on_timer(self):
        trajectory, now = self._trajectory, self._handle.time()
        if trajectory is None:
            return
        message = full_state_message(trajectory.goal(now), self._frame)
        message.header.stamp = self._handle.stamp()
        self._publisher.publish(message)
        if now >= max(trajectory.end, self._next_hold) and self._last_turn.done():
            self._next_hold = now + RETRY_PERIOD
            held = self.hand_over(partial(self._hold, trajectory.destination))
            held.add_done_callback(partial(self._note_hold, trajectory))

    def _note_hold(self, trajectory, held):
        # Another trajectory may have begun.
        if held.exception() is not None and self._trajectory is trajectory:
            self.fault = (
                f"the trajectory has ended, and go_to has failed: {held.exception()}; setpoints "
                "go on at its end"
            )


class SetpointPublishers:
    """Publishes low-level setpoints of a vehicle on the driver's topics below ``top``."""

    def __init__(self, handle: NodeHandle, top: str):
        self._handle = handle
        self._top = top
        self._publishers: dict[str, Publisher] = {}

    def publish(self, setpoint: Setpoint) -> None:
        """Publish a setpoint; the first of each type waits until a node subscribes."""
        topic, message = message_of(setpoint)
        publisher = self._publishers.get(topic) or self._connect(topic, type(message))
        if hasattr(message, "header"):
            message.header.stamp = self._handle.stamp()
        publisher.publish(message)

    def _connect(self, topic, message_type):
        publisher = self._handle.publisher(f"{self._top}/{topic}", message_type)
        self._publishers[topic] = publisher
        end = time.monotonic() + _CONNECTION_LIMIT
        while not publisher.has_subscribers() and time.monotonic() < end:
            time.sleep(0.01)
        return publisher


def message_of(setpoint: Setpoint) -> tuple[str, Any]:
    """Return the driver's topic and message, without a stamp.

    Yaw rates of messages are clockwise, in deg/s.
    """
    if isinstance(setpoint, FullStateSetpoint):
        position, velocity, acceleration, yaw, omega = setpoint
        message = full_state_message(Goal(position, velocity, acceleration, yaw, omega[2]))
        message.twist.angular = Vector3(*omega)
        return "cmd_full_state", message
    if isinstance(setpoint, PositionSetpoint):
        x, y, z = setpoint.position
        return "cmd_position", Position(x=x, y=y, z=z, yaw=math.degrees(setpoint.yaw))
    if isinstance(setpoint, VelocityWorldSetpoint):
        velocity = Vector3(*setpoint.velocity)
        return "cmd_velocity_world", VelocityWorld(vel=velocity, yawRate=-setpoint.yaw_rate)
    if isinstance(setpoint, HoverSetpoint):
        vx, vy, yaw_rate, height = setpoint
        return "cmd_hover", Hover(vx=vx, vy=vy, yawrate=-yaw_rate, zDistance=height)
    if isinstance(setpoint, AttitudeSetpoint):
        linear = Vector3(setpoint.pitch, setpoint.roll, setpoint.thrust)
        return "cmd_vel", Twist(linear, Vector3(0.0, 0.0, -setpoint.yaw_rate))
    return "cmd_stop", Empty()
