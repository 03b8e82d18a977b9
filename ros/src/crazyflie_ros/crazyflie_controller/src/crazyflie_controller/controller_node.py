"""ROS interface of the flight to a goal."""

import contextlib
from collections.abc import Iterator

from geometry_msgs.msg import PoseStamped, Twist, Vector3
from std_srvs.srv import Empty
from typing_extensions import override

from crazyflie_controller.flight import GoToFlight, State
from crazyflie_controller.go_to import GoToController, PidParameters
from crazyflie_controller.pose_source import PoseParameters, PoseSource, heading_pose
from crazyflie_utils import Node, NodeHandle, ServiceError, parameter
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.refusal import RefusalError

_DESCENT_LIMIT = 7.0  #: Longest descent at a shutdown, s: the process is killed after 10 s.


class ControllerParameters(PoseParameters):
    """Parameters of `ControllerNode`."""

    frequency: float = parameter(Number("Hz", above=0.0), "rate of setpoints", 50.0)
    pid_x: PidParameters = group(PidParameters, "PIDs/X")
    pid_y: PidParameters = group(PidParameters, "PIDs/Y")
    pid_z: PidParameters = group(PidParameters, "PIDs/Z")
    pid_yaw: PidParameters = group(PidParameters, "PIDs/Yaw")

    @property
    def pids(self) -> dict[str, PidParameters]:
        """Gains and limits by `go_to.AXES`."""
        return {"X": self.pid_x, "Y": self.pid_y, "Z": self.pid_z, "Yaw": self.pid_yaw}

    @override
    def complaints(self) -> Iterator[str]:
        for axis, pid in self.pids.items():
            for lower, minimum, upper, maximum in (
                ("minOutput", pid.min_output, "maxOutput", pid.max_output),
                ("integratorMin", pid.integrator_min, "integratorMax", pid.integrator_max),
            ):
                if minimum > maximum:
                    yield (
                        f"parameter PIDs/{axis}/{lower} is {minimum:g}; expected at most "
                        f"{upper}, {maximum:g}"
                    )


class ControllerNode(Node):
    """Fly a vehicle, by its pose from tf, to the goal of a topic."""

    needed_in_flight = True

    def __init__(self) -> None:
        self._is_inhibited = False

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(ControllerParameters, self._reconfigure)
        self._controller = GoToController(self._parameters.pids)
        self._flight = GoToFlight(self._controller)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher("cmd_vel", Twist)
        self._inhibit_shutdown = handle.inhibit_shutdown(lambda _: self.prepare_shutdown())
        self._source = PoseSource(handle, self._parameters)
        handle.advertise_service("takeoff", Empty, self._on_takeoff)
        handle.advertise_service("land", Empty, self._on_land)
        handle.subscribe("goal", PoseStamped, self._on_goal, finite="pose")
        handle.timer(1.0 / self._parameters.frequency, self._on_timer)

    @override
    def prepare_shutdown(self) -> None:
        """Land before the process ends."""
        # Refused on the ground, or if the vehicle is landing already.
        with contextlib.suppress(RefusalError):
            self._flight.land()
        self._flight.land_within(_DESCENT_LIMIT)

    def _reconfigure(self, parameters):
        self._controller.reconfigure(parameters.pids)

    def _on_takeoff(self, _):
        return self._begin("takeoff", self._take_off)

    def _on_land(self, _):
        return self._begin("land", self._flight.land)

    def _take_off(self):
        if self._handle.is_ending:
            raise RefusalError(f"{self._handle.name} is to end")
        self._flight.take_off()

    def _begin(self, service, manoeuvre):
        try:
            manoeuvre()
        except RefusalError as reason:
            raise ServiceError(f"{self._handle.resolve(service)} refused: {reason}") from None

    def _on_goal(self, message):
        world_frame = self._parameters.world_frame
        frame = message.header.frame_id.lstrip("/")
        if frame not in ("", world_frame):
            self._handle.warn(
                f"a goal names the frame {frame}; it is used as a goal in {world_frame}",
                throttle=5.0,
            )
        p, q = message.pose.position, message.pose.orientation
        rotation = q.x, q.y, q.z, q.w
        if not any(rotation):
            self._handle.warn(
                "ignoring a goal whose orientation is (0, 0, 0, 0); expected a quaternion, "
                "such as (0, 0, 0, 1)",
                throttle=1.0,
            )
            return
        self._flight.goal = heading_pose((p.x, p.y, p.z), rotation)

    def _on_timer(self):
        before = self._flight.state
        setpoint = self._flight.tick(self._handle.time(), *self._source.latest())
        if setpoint is not None:
            self._publisher.publish(
                Twist(
                    linear=Vector3(setpoint.pitch, setpoint.roll, setpoint.thrust),
                    angular=Vector3(0.0, 0.0, setpoint.yaw_rate),
                )
            )
        warning = self._flight.take_warning()
        if warning is not None:
            self._handle.warn(warning, throttle=1.0)
        if self._flight.state is not before:
            self._handle.info(self._flight.state.value)
        in_flight = self._flight.state is not State.IDLE
        if in_flight is not self._is_inhibited:
            self._is_inhibited = in_flight
            self._inhibit_shutdown(in_flight)
