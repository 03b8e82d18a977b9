"""Vehicles on a fake process: what a takeoff server and a controller do, and what a driver does."""

from geometry_msgs.msg import PoseStamped, Quaternion
from std_srvs.srv import Empty, EmptyResponse

from crazyflie_driver import srv
from crazyflie_driver.msg import FullState
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
    VehicleStatus,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.tf.frame_tree import StampedPose


class ControllerVehicle:
    """A vehicle that is at once where its reference is; ``in_flight`` is its server's topic."""

    def __init__(self, process, name, position, in_flight="in_flight"):
        self.position = list(position)
        self.yaw = 0.0
        self.refusal = ""
        handle = process.handle(f"/{name}/controller")
        self._state = handle.publisher("state", PositionVelocityYawStateStamped)
        self._flight_state = handle.publisher(
            f"{in_flight}_flight_status", FlightStatus, latch=True
        )
        handle.set_param("~topics/in_flight", in_flight)
        handle.advertise_service("takeoff", Empty, self._on_takeoff)
        handle.advertise_service("land", Empty, self._on_land)
        handle.advertise_service("emergency", Empty, self._on_land)
        handle.subscribe("ref", PositionVelocityStateStamped, self._on_reference)
        handle.timer(0.05, self._on_timer)
        self.be("on_ground")

    def be(self, state):
        """Tell a flight state."""
        self._flight_state.publish(FlightStatus(state=getattr(FlightStatus, state.upper())))

    def _on_takeoff(self, _):
        if self.refusal:
            raise ServiceError(self.refusal)
        self.position[2] = 1.0
        self._on_timer()
        self.be("taking_off")
        self.be("flying")
        return EmptyResponse()

    def _on_land(self, _):
        self.position[2] = 0.0
        self.be("descending")
        self.be("on_ground")
        return EmptyResponse()

    def _on_reference(self, message):
        s = message.state
        self.position = [s.x, s.y, s.z]

    def _on_timer(self):
        message = PositionVelocityYawStateStamped()
        message.state.x, message.state.y, message.state.z = self.position
        message.state.yaw = self.yaw
        self._state.publish(message)


class DriverVehicle:
    """A vehicle that is at once where it was told to be, behind the driver's services.

    With a ``frame`` its position is that of tf's frame ``name`` in it, else it comes as a pose.
    """

    def __init__(self, process, name, position, frame=None):
        self.position = list(position)
        self.yaw = 0.0
        self.requests = []
        self.setpoints = []
        self.is_tracked = True
        self.refusals = {}
        self._frames = (frame, name)
        self._handle = handle = process.handle(f"/{name}/driver")
        self._pose = handle.publisher("pose", PoseStamped)
        self._broadcast = handle.broadcast_poses()
        self._status = handle.publisher("vehicle_status", VehicleStatus, latch=True)
        for service, service_type in (
            ("takeoff", srv.Takeoff),
            ("land", srv.Land),
            ("go_to", srv.GoTo),
            ("upload_trajectory", srv.UploadTrajectory),
            ("start_trajectory", srv.StartTrajectory),
            ("stop", srv.Stop),
            ("update_params", srv.UpdateParams),
            ("emergency", Empty),
            ("set_led_color", srv.SetLedColor),
        ):
            handle.advertise_service(service, service_type, self._answer(service, service_type))
        handle.subscribe("cmd_full_state", FullState, self._on_setpoint)
        handle.timer(0.05, self._on_timer)

    def tell(self, status):
        """Publish the vehicle's status: "flying", "ready", "lost", with "battery critical"."""
        flies, lost = status.startswith("flying"), status.startswith("lost")
        self._status.publish(
            VehicleStatus(
                link=VehicleStatus.LOST if lost else VehicleStatus.CONNECTED,
                has_supervisor=not lost,
                supervisor=VehicleStatus.FLYING if flies else VehicleStatus.ARMED,
                battery=VehicleStatus.BATTERY_CRITICAL
                if "battery critical" in status
                else VehicleStatus.BATTERY_GOOD,
                text=status,
            )
        )

    def called(self):
        """Return the names of the services that were called."""
        return [name for name, _ in self.requests]

    def _answer(self, name, service_type):
        def answer(request):
            self.requests.append((name, request))
            if name in self.refusals:
                raise ServiceError(self.refusals[name])
            if name in ("takeoff", "land"):
                self.position[2] = request.height
                flies = name == "takeoff"
                self.tell("flying: on high-level commands" if flies else "ready: armed")
            elif name == "go_to":
                goal = request.goal
                begin = self.position if request.relative else (0.0, 0.0, 0.0)
                goal = goal.x, goal.y, goal.z
                self.position = [a + b for a, b in zip(begin, goal, strict=True)]
            elif name == "start_trajectory":
                last = self.requests[-2][1].pieces[-1]
                seconds = last.duration.to_sec()
                self.position = [
                    sum(c * seconds**k for k, c in enumerate(axis))
                    for axis in (last.poly_x, last.poly_y, last.poly_z)
                ]
            return service_type._response_class()

        return answer

    def _on_setpoint(self, message):
        self.setpoints.append(message)
        p = message.pose.position
        self.position = [p.x, p.y, p.z]

    def _on_timer(self):
        if not self.is_tracked:
            return
        rotation = quaternion_from_rpy(0.0, 0.0, self.yaw)
        if self._frames[0] is not None:
            stamp = self._handle.nanoseconds()
            self._broadcast([StampedPose(*self._frames, stamp, tuple(self.position), rotation)])
            return
        message = PoseStamped()
        message.pose.orientation = Quaternion(*rotation)
        p = message.pose.position
        p.x, p.y, p.z = self.position
        self._pose.publish(message)
