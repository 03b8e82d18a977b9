"""ROS interface of the state estimators."""

import math
from typing import Any

import genpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.limits import CRASH_TILT, HOLD_LIMIT, MAX_SPEED
from crazyflie_msgs.msg import (
    ControlStamped,
    EstimateStatus,
    FullStateStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_state_estimator.control_response import ControlInput
from crazyflie_state_estimator.motion import (
    ACCELERATION_WALK,
    ACCELERATION_WALK_WITH_CONTROL,
    ANGLE_NOISE,
    ANGULAR_ACCELERATION_WALK,
    POSITION_NOISE,
    ClockStepMonitor,
    ConstantAccelerationFilter,
    EstimatedMotion,
    FiniteDifference,
    MotionEstimator,
)
from crazyflie_state_estimator.pose_monitor import PoseMonitor, TiltMonitor, Verdict
from crazyflie_utils import Node, NodeHandle, Parameters, TransformError, parameter, topic
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, TIME_STEP, Integer, Number, Text
from crazyflie_utils.vectors import from_vector, stamped, to_tuple

FINITE_DIFFERENCE, KALMAN = "finite_difference", "kalman"


class StateEstimatorParameters(Parameters):
    """Parameters of an estimator of 7 states; subclasses declare another `x_dim`."""

    x_dim: int = parameter(Integer(7, 7), "number of fields of the state")
    time_step: float = parameter(TIME_STEP, "period at which tf is read")
    fixed_frame: str = parameter(FRAME, "frame the state is in", name="frames/fixed")
    robot_frame: str = parameter(FRAME, "frame of the vehicle", name="frames/robot")
    state_topic: str = topic("state", "where states go")
    own_status_topic: str | None = topic(
        "estimate_status", "by default the name of state + `_status`", None
    )
    acts_on_arrival: bool = parameter(
        BOOLEAN,
        "answer a new pose at once, at most one every `time_step`, instead of at the next time "
        "step",
        False,
        "act_on_arrival",
    )
    filter_type: str = parameter(
        Text((FINITE_DIFFERENCE, KALMAN)), "how rates are found", FINITE_DIFFERENCE, "filter/type"
    )
    control_topic: str | None = topic(
        "control",
        "the vehicle's control, such as /control/final: poses must follow it, and the Kalman "
        "filter uses it",
        None,
    )
    max_speed: float = parameter(
        Number("m/s", above=0.0),
        "largest plausible speed: poses that require a higher one are rejected",
        MAX_SPEED,
        "pose/max_speed",
    )
    max_tilt: float = parameter(
        Number("rad", above=0.0),
        "tilt above which a vehicle has crashed",
        CRASH_TILT,
        "pose/max_tilt",
    )

    @property
    def status_topic(self) -> str:
        """Topic of the status of poses and estimate."""
        return self.own_status_topic or f"{self.state_topic}_status"


# Their squares, and quotients of these, are far from the ends of the range of floats.
_ACCELERATION_WALK = Number("m/s^2/sqrt(s)", minimum=1e-6, maximum=1e6)
_ACCELERATION_WALK_HELP = (
    "by how much the unknown part of the acceleration changes in a second (standard deviation)"
)


class KalmanParameters(Parameters):
    """Parameters of the Kalman filter where the control is not known."""

    position_noise: float = parameter(
        Number("m", minimum=1e-6, maximum=100.0),
        "standard deviation of the poses' coordinates",
        POSITION_NOISE,
        "filter/position_noise",
        live=True,
    )
    acceleration_walk: float = parameter(
        _ACCELERATION_WALK,
        _ACCELERATION_WALK_HELP,
        ACCELERATION_WALK,
        "filter/acceleration_walk",
        live=True,
    )
    angle_noise: float = parameter(
        Number("rad", minimum=1e-6, maximum=10.0),
        "standard deviation of the poses' angles",
        ANGLE_NOISE,
        "filter/angle_noise",
        live=True,
    )
    angular_acceleration_walk: float = parameter(
        Number("rad/s^2/sqrt(s)", minimum=1e-6, maximum=1e6),
        "as `filter/acceleration_walk`, of roll, pitch and yaw",
        ANGULAR_ACCELERATION_WALK,
        "filter/angular_acceleration_walk",
        live=True,
    )


class KalmanWithControlParameters(KalmanParameters):
    """Parameters of the Kalman filter where the control is known."""

    acceleration_walk: float = parameter(
        _ACCELERATION_WALK,
        _ACCELERATION_WALK_HELP,
        ACCELERATION_WALK_WITH_CONTROL,
        "filter/acceleration_walk",
        live=True,
    )


REPORT_PERIOD = 1.0  #: Period of the diagnostics, as REP 107 recommends (s).
STATUS_PERIOD = 0.5  #: Period of the status while it does not change (s).
SILENCE_PERIOD = 0.1  #: Period at which an estimator that acts on arrival checks for silence (s).
UNKNOWN = (math.nan,) * 3  #: A disturbance, while it is not known.

_STATUS = {
    Verdict.GOOD: (EstimateStatus.GOOD, ""),
    Verdict.MOVED: (EstimateStatus.GOOD, ""),
    Verdict.REPEATED: (
        EstimateStatus.REPEATED,
        "the pose of {} repeats in flight; is motion capture frozen?",
    ),
    Verdict.IMPOSSIBLE: (EstimateStatus.IMPOSSIBLE, "{} cannot have flown to its pose"),
    Verdict.NOT_RESPONDING: (
        EstimateStatus.NOT_RESPONDING,
        "the poses of {} do not follow its control; is motion capture frozen? Or are they those of "
        "another body?",
    ),
}


class StateEstimatorNode(Node[StateEstimatorParameters]):
    """Publishes the state of a vehicle from its pose on tf."""

    needed_in_flight = True

    state_type: type  #: Stamped message to publish, with a field ``state``, all float64.

    def __init__(self) -> None:
        self._control = ControlInput()
        self._clock_steps = ClockStepMonitor()
        #: Time of the last state, or of the first attempt: simulated time may begin anywhere.
        self._last_success: float | None = None
        self._stamp: int | None = None
        self._last_pose = -math.inf  #: Time at which the last new pose came.
        self._is_tilted = False
        self._pose_status: tuple[int, str] = (EstimateStatus.MISSING, "there has been no pose yet")
        self._good_stamp = genpy.Time()
        self._told: tuple[Any, ...] | None = None
        self._told_at = -math.inf
        self._inner_type = type(self.state_type().state)

    def state(self, motion: EstimatedMotion) -> list[float]:
        """Return the state, in the order of the message's fields."""
        raise NotImplementedError

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(self.parameters_type)
        knows_control = self._parameters.control_topic is not None
        self._monitor = PoseMonitor(self._parameters.max_speed, knows_control)
        self._tilt = TiltMonitor(self._parameters.max_tilt)
        robot = self._parameters.robot_frame
        self._statuses = {key: (pose, text.format(robot)) for key, (pose, text) in _STATUS.items()}
        if self._parameters.filter_type == KALMAN:
            self._estimator = self._load_kalman_filters(handle)
        else:
            least_step = self._parameters.time_step / 2.0
            filters = FiniteDifference(least_step), FiniteDifference(least_step)
            self._estimator = MotionEstimator(*filters)

    def _load_kalman_filters(self, handle):
        knows_control = self._parameters.control_topic is not None
        parameters = handle.load(
            KalmanWithControlParameters if knows_control else KalmanParameters, self._reconfigure
        )
        self._position_filter = ConstantAccelerationFilter(
            parameters.position_noise, parameters.acceleration_walk
        )
        self._angle_filter = ConstantAccelerationFilter(
            parameters.angle_noise, parameters.angular_acceleration_walk
        )
        return MotionEstimator(self._position_filter, self._angle_filter)

    def _reconfigure(self, parameters):
        self._position_filter.tune(parameters.position_noise, parameters.acceleration_walk)
        self._angle_filter.tune(parameters.angle_noise, parameters.angular_acceleration_walk)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.state_topic, self.state_type)
        self._status = handle.publisher(parameters.status_topic, EstimateStatus, latch=True)
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        self._lookup = handle.listen_to_poses()
        if parameters.control_topic is not None:
            handle.subscribe(
                parameters.control_topic, ControlStamped, self._on_control, finite="control"
            )
        if parameters.acts_on_arrival:
            handle.on_pose(parameters.robot_frame, parameters.time_step, self._estimate)
            handle.timer(max(parameters.time_step, SILENCE_PERIOD), self._watch)
        else:
            handle.timer(parameters.time_step, self._estimate)
        handle.timer(REPORT_PERIOD, self._report, stagger=True)

    def _on_control(self, message):
        self._control.command(to_tuple(message.control), self._handle.time())

    def _watch(self):
        # Without arrivals `_estimate` would not run and report the silence.
        now = self._handle.time()
        if not 0.0 <= self._silence(now) < HOLD_LIMIT:
            self._estimate()
        else:
            self._publish_status(now)

    def _silence(self, now):
        """Return the time since the last state, or since the first call (s)."""
        if self._last_success is None:
            self._last_success = now
        return now - self._last_success

    def _estimate(self):
        now = self._handle.time()
        self._read_pose(now)
        self._publish_status(now)

    def _read_pose(self, now):
        if self._silence(now) < 0.0:
            # The simulation was reset, and the estimate belongs to the previous run.
            self._estimator.reset()
            self._monitor.reset()
            self._last_success = self._last_pose = now
        try:
            pose = self._lookup(self._parameters.fixed_frame, self._parameters.robot_frame)
        except TransformError as error:
            self._report_no_state(now, str(error))
            return
        motion = self._update(pose, now)
        if motion is None:
            self._report_no_state(now, "", pose)
            return
        self._last_success = now
        state = from_vector(self._inner_type, self.state(motion))
        frame = self._parameters.fixed_frame
        self._publisher.publish(stamped(self.state_type, pose.time, frame, state=state))

    def _update(self, pose, now):
        if pose.stamp == self._stamp:
            return None
        self._stamp, self._last_pose = pose.stamp, now
        self._watch_tilt(pose.rotation)
        stamp = pose.stamp * 1e-9
        if self._clock_steps.update(stamp, now, self._handle.nanoseconds):
            self._estimator.reset()
            self._monitor.restart()
        attitude = rpy_from_quaternion(*pose.rotation)
        acceleration = self._control.acceleration(attitude[2], now)
        verdict = self._monitor.update(stamp, pose.position, pose.rotation, acceleration)
        response = self._control.response(acceleration, now)
        was_good = self._pose_status[0] == EstimateStatus.GOOD
        self._pose_status = status, reason = self._statuses[verdict]
        if verdict is Verdict.IMPOSSIBLE:
            return None
        if status != EstimateStatus.GOOD:
            self._handle.warn(reason, throttle=1.0, key="frozen")
            # The predicted motion, when the measured one has just turned out to be wrong.
            departure = self._monitor.departure
            is_new = verdict is Verdict.REPEATED and was_good and departure is None
            if is_new and response is not None:
                return self._estimator.without_last(pose.stamp, response)
            return departure and EstimatedMotion(*departure, attitude, (0.0, 0.0, 0.0))
        if verdict is Verdict.MOVED:
            self._estimator.reset()
        self._good_stamp = pose.time
        return self._estimator.update(pose.stamp, pose.position, attitude, response)

    def _publish_status(self, now):
        facts = *self._pose_status, self._is_tilted
        if facts == self._told and 0.0 <= now - self._told_at < STATUS_PERIOD - 1e-6:
            return
        self._told, self._told_at = facts, now
        pose, reason, is_tilted = facts
        status = stamped(
            EstimateStatus,
            self._good_stamp,
            self._parameters.fixed_frame,
            pose=pose,
            reason=reason,
            is_tilted=is_tilted,
            disturbance=self._monitor.disturbance or UNKNOWN,
        )
        self._status.publish(status)

    def _watch_tilt(self, rotation):
        is_tilted = self._tilt.update(*rotation[:2])
        if is_tilted and not self._is_tilted:
            self._handle.warn("the vehicle has tipped over", throttle=1.0)
        self._is_tilted = is_tilted

    def _rejections(self):
        """Return the numbers of rejected poses by reason."""
        return {
            "is too far away": self._monitor.impossible,
            "does not follow the control": self._monitor.frozen,
            **self._handle.rejected_transforms(),
        }

    def _report(self):
        silence = self._silence(self._handle.time())
        is_silent = silence > HOLD_LIMIT
        rejected = self._rejections()
        values = [KeyValue(f"rejected: {key}", str(count)) for key, count in rejected.items()]
        status = DiagnosticStatus(
            level=DiagnosticStatus.ERROR if is_silent else DiagnosticStatus.OK,
            name=f"{self._handle.name.lstrip('/')}: poses",
            message=f"no state for {silence:.1f} s" if is_silent else "states are published",
            values=[KeyValue("rejected", str(sum(rejected.values()))), *values],
        )
        header = Header(stamp=self._handle.stamp())
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))

    def _report_no_state(self, now, reason, pose=None):
        # Shorter silences are ordinary: at the start, and when time_step is
        # shorter than the period of the transforms.
        silence = self._silence(now)
        if silence < HOLD_LIMIT:
            return
        if now - self._last_pose >= HOLD_LIMIT:
            frames = f"{self._parameters.fixed_frame} -> {self._parameters.robot_frame}"
            self._pose_status = EstimateStatus.MISSING, reason or f"no new transform {frames}"
        if pose is not None:
            rejected = sum(self._rejections().values())
            reason = (
                f"the latest is that of {pose.stamp * 1e-9:.3f} s; {rejected} poses were rejected"
            )
        self._handle.warn(
            f"no state: no new transform {self._parameters.fixed_frame} -> "
            f"{self._parameters.robot_frame} for {silence:.1f} s ({reason})",
            throttle=1.0,
            key="no state",
        )


class PositionVelocityStateEstimatorParameters(StateEstimatorParameters):
    """Parameters of `PositionVelocityStateEstimatorNode`."""

    x_dim: int = parameter(Integer(6, 6), "number of fields of the state")


class PositionVelocityStateEstimatorNode(StateEstimatorNode):
    """Publish x, y, z, x_dot, y_dot, z_dot."""

    state_type = PositionVelocityStateStamped
    parameters_type = PositionVelocityStateEstimatorParameters

    @override
    def state(self, motion: EstimatedMotion) -> list[float]:
        return [*motion.position, *motion.velocity]


class PositionVelocityYawStateEstimatorNode(StateEstimatorNode):
    """Publish x, y, z, x_dot, y_dot, z_dot, yaw."""

    state_type = PositionVelocityYawStateStamped

    @override
    def state(self, motion: EstimatedMotion) -> list[float]:
        return [*motion.position, *motion.velocity, motion.attitude[2]]


class FullStateEstimatorParameters(StateEstimatorParameters):
    """Parameters of `FullStateEstimatorNode`."""

    x_dim: int = parameter(Integer(12, 12), "number of fields of the state")


class FullStateEstimatorNode(StateEstimatorNode):
    """Publish position, velocity, attitude and the rates of the attitude's angles."""

    state_type = FullStateStamped
    parameters_type = FullStateEstimatorParameters

    @override
    def state(self, motion: EstimatedMotion) -> list[float]:
        return [number for part in motion for number in part]
