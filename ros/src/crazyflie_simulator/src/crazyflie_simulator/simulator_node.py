"""ROS interface of a simulated vehicle, whatever its model."""

import zlib

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3

from crazyflie_model.dynamics import Coupled7D, Dynamics, NearHover
from crazyflie_msgs.msg import ControlStamped
from crazyflie_simulator.motion_capture import MotionCapture
from crazyflie_simulator.vehicle import Vehicle
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import (
    BOOLEAN,
    DURATION,
    FRAME,
    METRES,
    TIME_STEP,
    TOPIC,
    Integer,
    Number,
)
from crazyflie_utils.parameters import ParameterError
from crazyflie_utils.vectors import is_finite, to_vector

_LENGTH = Number(unit="m", minimum=0.0)
_ANGLE = Number(unit="rad", minimum=0.0)
_PROBABILITY = Number(minimum=0.0, maximum=1.0)
SEED = Integer(0, 2**32 - 1)
"""Kind of the parameter ``seed``."""


class SimulatorNode(Node):
    """Fly a vehicle on the controls of a topic and tell tf where it is.

    A subclass says in `load_dynamics` what kind of vehicle.
    """

    def __init__(self):
        super().__init__()
        self._dynamics = None
        self._vehicle = None
        self._motion_capture = None
        self._time_step = None
        self._position = None
        self._fixed_frame = None
        self._robot_frame = None
        self._control_topic = None
        self._publishes_clock = False
        self._real_time_factor = None
        self._broadcast = None
        self._set_clock = None
        self._start = None
        self._ticks = 0
        self._measured_at = None

    def load_dynamics(self, handle) -> Dynamics:
        """Return the model of the vehicle, of the node's parameters if it has any.

        Raises
        ------
        ParameterError
        """
        raise NotImplementedError

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._time_step = handle.param("time_step", TIME_STEP)
        self._position = [handle.param(f"init/{axis}", METRES) for axis in "xyz"]
        self._fixed_frame = handle.param("frames/fixed", FRAME)
        self._robot_frame = handle.param("frames/robot", FRAME)
        self._control_topic = handle.param("topics/control", TOPIC)
        self._publishes_clock = handle.param("clock/publish", BOOLEAN, False)
        self._real_time_factor = handle.param("clock/real_time_factor", Number(minimum=0.0), 1.0)
        if self._publishes_clock and not handle.uses_sim_time:
            raise ParameterError(
                f"parameter {handle.resolve('~clock/publish')} is true, but /use_sim_time is "
                "not; expected both, so that somebody listens to /clock"
            )
        self._motion_capture = MotionCapture(
            position_noise=handle.param("mocap/position_noise", _LENGTH, 0.0),
            attitude_noise=handle.param("mocap/attitude_noise", _ANGLE, 0.0),
            latency=handle.param("mocap/latency", DURATION, 0.0),
            dropout=handle.param("mocap/dropout", _PROBABILITY, 0.0),
            # Vehicles with the same seed do not make the same errors.
            seed=(handle.param("seed", SEED, 0), zlib.crc32(handle.name.encode())),
        )
        self._dynamics = self.load_dynamics(handle)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._start = handle.time()
        self._vehicle = Vehicle(self._dynamics, self._position, self._start)
        self._broadcast = handle.broadcast_transforms()
        if self._publishes_clock:
            self._set_clock = handle.clock_publisher()
        handle.subscribe(self._control_topic, ControlStamped, self._on_control)
        if self._publishes_clock:
            factor = self._real_time_factor
            period = self._time_step / factor if factor > 0.0 else 0.0
            handle.timer(period, self._on_clock_timer, steady=True)
        else:
            handle.timer(self._time_step, self._on_timer)

    def _on_control(self, message):
        if not is_finite(message.control):
            self._handle.warn(
                f"ignoring a control on {self._control_topic} that is not finite", throttle=1.0
            )
            return
        # Without a clock of its own, the vehicle has to catch up first, so that
        # the control takes effect now and not at the last tick.
        if not self._publishes_clock:
            self._vehicle.advance_to(self._handle.time())
        self._vehicle.command(to_vector(message.control))

    def _on_timer(self):
        self._vehicle.advance_to(self._handle.time())
        self._broadcast_pose()

    def _on_clock_timer(self):
        self._ticks += 1
        now = self._start + self._ticks * self._time_step
        self._vehicle.advance_to(now)
        self._broadcast_pose()
        self._set_clock(now)

    def _broadcast_pose(self):
        now = self._vehicle.time
        if now == self._measured_at:
            return
        self._measured_at = now
        self._motion_capture.measure(now, *self._vehicle.pose)
        transforms = [self._transform(*pose) for pose in self._motion_capture.arrivals(now)]
        if transforms:
            self._broadcast(transforms)

    def _transform(self, time, position, quaternion):
        transform = TransformStamped()
        transform.header.stamp = self._handle.stamp(time)
        transform.header.frame_id = self._fixed_frame
        transform.child_frame_id = self._robot_frame
        transform.transform.translation = Vector3(*position)
        transform.transform.rotation = Quaternion(*quaternion)
        return transform


class NearHoverSimulatorNode(SimulatorNode):
    """A vehicle with near-hover dynamics."""

    def load_dynamics(self, handle) -> Dynamics:
        """See `SimulatorNode.load_dynamics`."""
        return NearHover()


class NearHoverSimulatorCoupled7DNode(SimulatorNode):
    """A vehicle whose thrust, tilt and yaw are coupled."""

    def load_dynamics(self, handle) -> Dynamics:
        """See `SimulatorNode.load_dynamics`."""
        return Coupled7D()
