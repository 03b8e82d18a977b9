"""ROS interface of the flight to a goal."""

from geometry_msgs.msg import PoseStamped, Twist, Vector3
from std_srvs.srv import Empty, EmptyResponse

from crazyflie_controller.flight import Flight
from crazyflie_controller.go_to import AXES, GoToController, Pose
from crazyflie_controller.pid import Gains
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import FINITE, FRAME, Number
from crazyflie_utils.parameters import ParameterError
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.runtime.transforms import TransformError
from crazyflie_utils.runtime.transport import ServiceError
from crazyflie_utils.vectors import is_finite

_GAINS = {
    "kp": "kp",
    "kd": "kd",
    "ki": "ki",
    "min_output": "minOutput",
    "max_output": "maxOutput",
    "integrator_min": "integratorMin",
    "integrator_max": "integratorMax",
}
"""Attribute of `Gains` -> parameter."""


class ControllerNode(Node):
    """Fly the vehicle that tf knows to the goal of a topic."""

    def __init__(self):
        super().__init__()
        self._world_frame = None
        self._frame = None
        self._period = None
        self._flight = None
        self._publisher = None
        self._lookup = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._world_frame = handle.param("worldFrame", FRAME, "world")
        self._frame = handle.param("frame", FRAME)
        self._period = 1.0 / handle.param("frequency", Number("Hz", above=0.0), 50.0)
        gains = {axis: _load_gains(handle, f"PIDs/{axis}") for axis in AXES}
        self._flight = Flight(GoToController(gains))

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher("cmd_vel", Twist)
        self._lookup = handle.listen_to_transforms()
        handle.advertise_service("takeoff", Empty, self._on_takeoff)
        handle.advertise_service("land", Empty, self._on_land)
        handle.subscribe("goal", PoseStamped, self._on_goal)
        handle.timer(self._period, self._on_timer)

    def _on_takeoff(self, _):
        return self._begin("takeoff", self._flight.take_off)

    def _on_land(self, _):
        return self._begin("land", self._flight.land)

    def _begin(self, service, manoeuvre):
        try:
            manoeuvre()
        except RefusalError as reason:
            raise ServiceError(f"{self._handle.resolve(service)} refused: {reason}") from None
        return EmptyResponse()

    def _on_goal(self, message):
        frame = message.header.frame_id.lstrip("/")
        if frame not in ("", self._world_frame):
            self._handle.warn(
                f"a goal names the frame {frame}; it is taken as one in {self._world_frame}",
                throttle=5.0,
            )
        position, q = message.pose.position, message.pose.orientation
        if not is_finite(message.pose):
            self._handle.warn("ignoring a goal that is not finite", throttle=1.0)
        elif q.x == q.y == q.z == q.w == 0.0:
            self._handle.warn(
                "ignoring a goal whose orientation is (0, 0, 0, 0); expected a quaternion, "
                "such as (0, 0, 0, 1)",
                throttle=1.0,
            )
        else:
            self._flight.set_goal(_pose(position, q))

    def _on_timer(self):
        before = self._flight.state
        setpoint = self._flight.tick(self._handle.time(), *self._look())
        if setpoint is not None:
            self._publisher.publish(
                Twist(
                    linear=Vector3(setpoint.pitch, setpoint.roll, setpoint.thrust),
                    angular=Vector3(0.0, 0.0, setpoint.yaw_rate),
                )
            )
        remark = self._flight.take_remark()
        if remark is not None:
            self._handle.warn(remark, throttle=1.0)
        if self._flight.state is not before:
            self._handle.info(self._flight.state.value)

    def _look(self):
        try:
            found = self._lookup(self._world_frame, self._frame)
        except TransformError as error:
            self._handle.warn(
                f"no pose of {self._frame} in {self._world_frame}: {error}", throttle=5.0, key="tf"
            )
            return None, None
        transform = found.transform
        return found.header.stamp.to_sec(), _pose(transform.translation, transform.rotation)


def _load_gains(handle, name):
    gains = Gains(
        **{key: handle.param(f"{name}/{parameter}", FINITE) for key, parameter in _GAINS.items()}
    )
    pairs = {
        "minOutput": (gains.min_output, gains.max_output, "maxOutput"),
        "integratorMin": (gains.integrator_min, gains.integrator_max, "integratorMax"),
    }
    for lower, (minimum, maximum, upper) in pairs.items():
        if minimum > maximum:
            raise ParameterError(
                f"parameter {handle.resolve(f'~{name}/{lower}')} is {minimum:g}; expected at "
                f"most {upper}, {maximum:g}"
            )
    return gains


def _pose(position, q):
    yaw = rpy_from_quaternion(q.x, q.y, q.z, q.w)[2]
    return Pose(position.x, position.y, position.z, yaw)
