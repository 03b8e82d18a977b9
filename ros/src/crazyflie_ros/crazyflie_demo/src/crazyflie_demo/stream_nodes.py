"""ROS interfaces of flights by streamed setpoints: positions, a trajectory, a constant thrust."""

import sys
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import Any

import genpy
import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from std_msgs.msg import Empty
from typing_extensions import override

from crazyflie_demo.flight_plan_nodes import TrajectoryFlightNode
from crazyflie_demo.node_parts import RATE, SetpointParameters
from crazyflie_demo.trajectory_file import TrajectoryError
from crazyflie_demo.uav_trajectory import Trajectory
from crazyflie_driver.msg import FullState, Position
from crazyflie_driver.setpoint_gate import OVERLAP
from crazyflie_driver.srv import Land, LandRequest
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_model.limits import MAX_SETPOINT_PWM
from crazyflie_utils import Node, NodeHandle, ParameterError, Parameters, parameter, run_nodes
from crazyflie_utils.parameters.types import METRES, TOPIC, Number
from crazyflie_utils.vectors import stamped

_LANDING = 2.0  #: Duration of the landing after an interrupted flight, s.
_LIMIT = 15.0  #: Longest time of a service call, s.
_FINISH_LIMIT = 10.0  #: Longest time in which a failed landing is requested again, s.
_RETRY_PERIOD = 1.0  #: Time between two requests (s).

#: Longest time of a landing's service call, s. `OVERLAP` after the landing the driver passes
#: setpoints on again, which override it: one that is accepted later is requested again.
_MAX_ANSWER_TIME = OVERLAP / 2.0


class StreamNode(Node):
    """Stream the setpoints of a flight as soon as the driver subscribes; then end the process.

    The last setpoint is repeated until the driver has accepted `finish`: without setpoints the
    firmware levels out after 0.5 s and stops the motors after 2 s. If the node is ended in
    flight, the vehicle is landed. A subclass sets topic, message type, duration (s) and rate (Hz)
    at the latest in `load_parameters`.
    """

    topic: str
    message_type: type
    duration: float
    rate: float

    def __init__(self) -> None:
        self._start: float | None = None
        self._is_flying = False
        self._next_finish: float | None = 0.0

    def setpoint(self, time: float) -> genpy.Message:
        """Return the setpoint of a time (s), 0 to `duration`."""
        raise NotImplementedError

    def finish(self) -> Future[Any] | None:
        """Request the command after the last setpoint; the process ends after the response."""
        return None

    def land(self) -> Future[Any]:
        """Request a landing by the high-level commander; return the response."""
        prefix = self._handle.resolve(self.topic).rpartition("/")[0]
        request = LandRequest(height=0.0, duration=genpy.Duration.from_sec(_LANDING))
        return self._handle.call_service(f"{prefix}/land", Land, request, _LIMIT)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self.topic, self.message_type)
        self._timer = handle.timer(1.0 / self.rate, self._on_timer)
        handle.info(f"waiting for {handle.resolve(self.topic)}")

    @override
    def enter_safe_state(self) -> None:
        if self._is_flying:
            self._is_flying = False
            self._handle.warn("landing")
            self.land()

    def _on_timer(self):
        now = self._handle.time()
        if self._start is None:
            # Setpoints without a subscriber are lost, and the flight would start in its middle.
            if not self._publisher.has_subscribers():
                return
            self._start = now
            self._finish_end = now + self.duration + _FINISH_LIMIT
            self._is_flying = True
            self._handle.info(f"flying, {self.duration:g} s")
        elapsed = now - self._start
        message = self.setpoint(min(elapsed, self.duration))
        message.header.stamp = self._handle.stamp()
        self._publisher.publish(message)
        if elapsed >= self.duration and self._next_finish is not None and now >= self._next_finish:
            self._next_finish = None
            answer = self.finish()
            if answer is None:
                self._end()
            else:
                answer.add_done_callback(partial(self._on_answer, now))

    def _on_answer(self, asked, done):
        now, error = self._handle.time(), done.exception()
        if error is None and now - asked <= _MAX_ANSWER_TIME:
            self._end()
        elif error is None:
            self._next_finish = now
        elif now < self._finish_end:
            self._handle.warn(f"the landing has failed and is retried: {error}")
            self._next_finish = now + _RETRY_PERIOD
        else:
            self._handle.error(
                f"MAY STILL FLY: the landing has failed for {_FINISH_LIMIT:g} s: {error}"
            )
            self._handle.end(1)

    def _end(self):
        self._is_flying = False
        self._timer.stop()
        self._handle.end(0)


class PositionFlightParameters(SetpointParameters):
    """Parameters of `PositionFlightNode`."""

    x: float = parameter(METRES, "start of the flight", 0.0)
    y: float = parameter(METRES, "start of the flight", 0.0)
    height: float = parameter(Number("m", above=0.0, maximum=3.0), "height of the flight", 0.4)
    distance: float = parameter(METRES, "distance ahead and to the left", 0.2)
    speed: float = parameter(
        Number("m/s", above=0.0, maximum=1.0), "duration of the whole flight", 0.2
    )


class PositionFlightNode(StreamNode):
    """Climb, go ahead and to the left, back, and land; then stop the motors."""

    topic, message_type = "cmd_position", Position

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        p = handle.load(PositionFlightParameters)
        side = [p.distance, p.distance, p.height]
        above = [0.0, 0.0, p.height]
        # Each place occurs twice, so that the vehicle stays there for a second.
        places = np.repeat([[0.0, 0.0, 0.0], above, side, above, [0.0, 0.0, 0.0]], 2, axis=0)
        durations = np.linalg.norm(np.diff(places, axis=0), axis=1) / p.speed
        durations[durations == 0.0] = 1.0
        self._times = np.concatenate([[0.0], np.cumsum(durations)])
        self._places = places + [p.x, p.y, 0.0]
        self.duration, self.rate = float(self._times[-1]), p.rate

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._stop = handle.publisher("cmd_stop", Empty)
        super().register_callbacks(handle)

    @override
    def setpoint(self, time: float) -> Position:
        x, y, z = (float(np.interp(time, self._times, axis)) for axis in self._places.T)
        return stamped(Position, genpy.Time(), "world", x=x, y=y, z=z, yaw=0.0)

    @override
    def finish(self) -> None:
        self._stop.publish(Empty())


_REST = np.zeros(3)


class TrajectoryStreamParameters(Parameters):
    """Parameters of `TrajectoryStreamNode`."""

    topic: str = parameter(TOPIC, "where setpoints go", "/crazyflie/cmd_full_state")
    rate: float = parameter(RATE, "rate of setpoints", 100.0)


class TrajectoryStreamNode(StreamNode):
    """Stream the trajectory of a CSV file as it is, in the world frame; then land."""

    message_type = FullState

    def __init__(self, file: str):
        super().__init__()
        self._file = file
        self._trajectory = Trajectory()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(TrajectoryStreamParameters)
        self.topic, self.rate = parameters.topic, parameters.rate
        try:
            self._trajectory.loadcsv(self._file)
        except TrajectoryError as error:
            raise ParameterError(str(error)) from None
        self.duration = self._trajectory.duration

    @override
    def setpoint(self, time: float) -> FullState:
        goal = self._trajectory.eval(time)
        if time >= self.duration:
            # The command is repeated until the vehicle lands.
            goal = replace(goal, vel=_REST, acc=_REST, omega=_REST)
        return stamped(
            FullState,
            genpy.Time(),
            "world",
            pose=Pose(Point(*goal.pos), Quaternion(*quaternion_from_rpy(0.0, 0.0, goal.yaw))),
            twist=Twist(Vector3(*goal.vel), Vector3(*goal.omega)),
            acc=Vector3(*goal.acc),
        )

    @override
    def finish(self) -> Future[Any]:
        # Without this, the vehicle would be locked 2 s later, or fall.
        return self.land()


class ConstThrustParameters(SetpointParameters):
    """Parameters of `ConstThrustNode`."""

    thrust: float = parameter(
        Number("PWM", minimum=0.0, maximum=MAX_SETPOINT_PWM),
        "thrust; about 42000 hovers",
        12000.0,
        live=True,
    )


class ConstThrustNode(Node[ConstThrustParameters]):
    """Publish level setpoints with a constant thrust; zero thrust before and after it."""

    def __init__(self) -> None:
        # The driver passes thrust on only after zero thrust: it may be from before.
        self._has_begun = False

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("cmd_vel", Twist)
        handle.timer(1.0 / self._parameters.rate, self._on_timer)

    @override
    def enter_safe_state(self) -> None:
        self._publisher.publish(Twist())

    def _on_timer(self):
        thrust = self._parameters.thrust if self._has_begun else 0.0
        self._has_begun = self._has_begun or self._publisher.has_subscribers()
        self._publisher.publish(Twist(linear=Vector3(0.0, 0.0, thrust)))


def execute_trajectory() -> None:
    """Fly along a trajectory of polynomials.

    One in a file on the command line is streamed; otherwise the parameter ``~file`` says which one
    is uploaded and flown by the vehicle itself.
    """
    # Remappings and private parameters are not files.
    files = [word for word in sys.argv[1:] if ":=" not in word]
    if len(files) > 1:
        sys.exit("usage: execute_trajectory.py [FILE.csv]")

    def make_nodes(handle: NodeHandle) -> dict[str, Node]:
        node = TrajectoryStreamNode(files[0]) if files else TrajectoryFlightNode()
        return {handle.name: node}

    run_nodes("execute_trajectory", make_nodes)
