"""ROS interface of a simulated vehicle."""

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3

from crazyflie_msgs.msg import ControlStamped
from crazyflie_simulator.dynamics import Dynamics, NearHover
from crazyflie_simulator.vehicle import Vehicle
from crazyflie_utils.node import Node
from crazyflie_utils.parameters import (
    BOOLEAN,
    FRAME,
    METRES,
    TIME_STEP,
    TOPIC,
    Number,
    ParameterError,
)
from crazyflie_utils.vectors import is_finite, to_vector


class SimulatorNode(Node):
    """Fly a vehicle on the controls of a topic and tell tf where it is.

    Parameters
    ----------
    dynamics : Dynamics
        Model of the vehicle.
    """

    def __init__(self, dynamics: Dynamics):
        super().__init__()
        self._dynamics = dynamics
        self._vehicle = None
        self._time_step = None
        self._position = None
        self._fixed_frame = None
        self._robot_frame = None
        self._control_topic = None
        self._publishes_clock = False
        self._real_time_factor = None
        self._broadcast = None
        self._set_clock = None
        self._ticks = 0
        self._broadcast_time = None

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

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._vehicle = Vehicle(self._dynamics, self._position, handle.time())
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
        now = self._ticks * self._time_step
        self._vehicle.advance_to(now)
        self._broadcast_pose()
        self._set_clock(now)

    def _broadcast_pose(self):
        if self._vehicle.time == self._broadcast_time:
            return
        self._broadcast_time = self._vehicle.time
        position, quaternion = self._vehicle.pose
        transform = TransformStamped()
        transform.header.stamp = self._handle.stamp(self._vehicle.time)
        transform.header.frame_id = self._fixed_frame
        transform.child_frame_id = self._robot_frame
        transform.transform.translation = Vector3(*map(float, position))
        transform.transform.rotation = Quaternion(*quaternion)
        self._broadcast([transform])


class NearHoverSimulatorNode(SimulatorNode):
    """A vehicle with near-hover dynamics."""

    def __init__(self):
        super().__init__(NearHover())
