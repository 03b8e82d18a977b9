"""ROS interface of the state estimators."""

import numpy as np

from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_msgs.msg import (
    ControlStamped,
    FullState,
    FullStateStamped,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_state_estimator import kalman
from crazyflie_state_estimator.control_input import ControlInput
from crazyflie_state_estimator.motion import Motion, MotionEstimator
from crazyflie_state_estimator.rate_filter import FiniteDifference
from crazyflie_utils.last_valid import HOLD_LIMIT
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import FRAME, TIME_STEP, TOPIC, Integer, Number, Text
from crazyflie_utils.runtime.transforms import TransformError
from crazyflie_utils.vectors import from_vector, is_finite, to_vector

FINITE_DIFFERENCE, KALMAN = "finite_difference", "kalman"


class StateEstimatorNode(Node):
    """Publish the state of the vehicle that tf knows.

    Parameters
    ----------
    stamped_type, state_type : type
        Message to publish, and the type of its field ``state``.
    """

    def __init__(self, stamped_type: type, state_type: type):
        super().__init__()
        self._stamped_type = stamped_type
        self._state_type = state_type
        self._time_step = None
        self._fixed_frame = None
        self._robot_frame = None
        self._state_topic = None
        self._control_topic = None
        self._control = ControlInput()
        self._estimator = None
        self._publisher = None
        self._lookup = None
        self._last_success = None

    def state(self, motion: Motion) -> np.ndarray:
        """Return the state vector, in the order of the message's fields."""
        raise NotImplementedError

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        x_dim = len(self._state_type.__slots__)
        handle.param("x_dim", Integer(x_dim, x_dim))
        self._time_step = handle.param("time_step", TIME_STEP)
        self._fixed_frame = handle.param("frames/fixed", FRAME)
        self._robot_frame = handle.param("frames/robot", FRAME)
        self._state_topic = handle.param("topics/state", TOPIC)
        kind = handle.param("filter/type", Text((FINITE_DIFFERENCE, KALMAN)), FINITE_DIFFERENCE)
        if kind == KALMAN:
            self._estimator = self._load_kalman_filters(handle)
        else:
            self._estimator = MotionEstimator(FiniteDifference(), FiniteDifference())

    def _load_kalman_filters(self, handle):
        self._control_topic = handle.param("topics/control", TOPIC, None)

        def positive(name, unit, default):
            return handle.param(f"filter/{name}", Number(unit=unit, above=0.0), default)

        walk = kalman.ACCELERATION_WALK
        if self._control_topic is not None:
            walk = kalman.ACCELERATION_WALK_WITH_CONTROL
        return MotionEstimator(
            kalman.ConstantAccelerationFilter(
                positive("position_noise", "m", kalman.POSITION_NOISE),
                positive("acceleration_walk", "m/s^2/sqrt(s)", walk),
            ),
            kalman.ConstantAccelerationFilter(
                positive("angle_noise", "rad", kalman.ANGLE_NOISE),
                positive(
                    "angular_acceleration_walk",
                    "rad/s^2/sqrt(s)",
                    kalman.ANGULAR_ACCELERATION_WALK,
                ),
            ),
        )

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._state_topic, self._stamped_type)
        self._lookup = handle.listen_to_transforms()
        if self._control_topic is not None:
            handle.subscribe(self._control_topic, ControlStamped, self._on_control)
        self._last_success = handle.time()
        handle.timer(self._time_step, self._on_timer)

    def _on_control(self, message):
        if is_finite(message.control):
            self._control.command(to_vector(message.control), self._handle.time())
        else:
            self._handle.warn(
                f"ignoring a control on {self._control_topic} that is not finite", throttle=1.0
            )

    def _on_timer(self):
        now = self._handle.time()
        if now < self._last_success:
            # The simulation was reset, and what is known belongs to the past one.
            self._estimator.reset()
            self._last_success = now
        try:
            transform = self._lookup(self._fixed_frame, self._robot_frame)
        except TransformError as error:
            self._report_no_state(now, str(error))
            return
        motion = self._update(transform, now)
        if motion is None:
            stamp = transform.header.stamp.to_sec()
            self._report_no_state(now, f"the latest is still that of {stamp:.3f} s")
            return
        self._last_success = now
        message = self._stamped_type(state=from_vector(self._state_type, self.state(motion)))
        message.header.stamp = transform.header.stamp
        message.header.frame_id = self._fixed_frame
        self._publisher.publish(message)

    def _update(self, transform, now):
        translation, rotation = transform.transform.translation, transform.transform.rotation
        attitude = rpy_from_quaternion(rotation.x, rotation.y, rotation.z, rotation.w)
        return self._estimator.update(
            transform.header.stamp.to_nsec(),
            (translation.x, translation.y, translation.z),
            attitude,
            self._control.acceleration(attitude[2], now),
        )

    def _report_no_state(self, now, reason):
        # Shorter silences are ordinary: at the start, and when time_step is
        # shorter than the period of the transforms.
        if now - self._last_success < HOLD_LIMIT:
            return
        self._handle.warn(
            f"no state: no new transform {self._fixed_frame} -> {self._robot_frame} "
            f"for {now - self._last_success:.1f} s ({reason})",
            throttle=1.0,
            key="no state",
        )


class PositionVelocityStateEstimatorNode(StateEstimatorNode):
    """Publish x, y, z, x_dot, y_dot, z_dot."""

    def __init__(self):
        super().__init__(PositionVelocityStateStamped, PositionVelocityState)

    def state(self, motion: Motion) -> np.ndarray:
        """See `StateEstimatorNode.state`."""
        return np.concatenate([motion.position, motion.velocity])


class PositionVelocityYawStateEstimatorNode(StateEstimatorNode):
    """Publish x, y, z, x_dot, y_dot, z_dot, yaw."""

    def __init__(self):
        super().__init__(PositionVelocityYawStateStamped, PositionVelocityYawState)

    def state(self, motion: Motion) -> np.ndarray:
        """See `StateEstimatorNode.state`."""
        return np.concatenate([motion.position, motion.velocity, motion.attitude[2:]])


class FullStateEstimatorNode(StateEstimatorNode):
    """Publish position, velocity, attitude and the rates of the attitude's angles."""

    def __init__(self):
        super().__init__(FullStateStamped, FullState)

    def state(self, motion: Motion) -> np.ndarray:
        """See `StateEstimatorNode.state`."""
        return np.concatenate(motion)
