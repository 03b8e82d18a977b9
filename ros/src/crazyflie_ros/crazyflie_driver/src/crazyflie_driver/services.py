"""Services of one vehicle."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from std_srvs.srv import Empty, EmptyResponse, SetBool, SetBoolResponse

from crazyflie_driver import srv
from crazyflie_driver.command import SERVICE_TYPES, requested
from crazyflie_driver.emergency import Emergency
from crazyflie_driver.flight_commands import FlightCommands
from crazyflie_driver.flight_state import FlightState
from crazyflie_driver.jobs import Jobs
from crazyflie_driver.parameter_mirror import ParameterMirror
from crazyflie_driver.service_names import ServiceNames
from crazyflie_driver.setpoint_gate import Event, SetpointGate
from crazyflie_driver.setup_services import SetupServices
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError


@dataclass(eq=False)
class VehicleServices:
    """Announce a vehicle's services and carry them out.

    What blocks on the vehicle is a job, where landing and stopping supersede what was asked
    before; all else is done at once.
    """

    _handle: NodeHandle
    _name: str
    _prefix: str
    _crazyflie: Crazyflie
    _jobs: Jobs
    _gate: SetpointGate
    _flight: FlightState
    _commands: FlightCommands
    _emergency: Emergency
    _mirror: ParameterMirror

    def __post_init__(self) -> None:
        self._names = ServiceNames(self._handle, self._prefix)

    def wait_for_names(self, is_over: Callable[[], bool]) -> None:
        """Wait for controllers whose services have these names; see `ServiceNames`."""
        self._names.wait_for_controllers(is_over)

    def advertise(self) -> None:
        """Offer all services that the vehicle has."""
        offered: dict[str, tuple[type, Callable[[Any], Any]]] = {
            "emergency": (Empty, self._on_emergency),
            "arm": (SetBool, self._on_arm),
            "update_params": (srv.UpdateParams, self._on_update_params),
            "set_group_mask": (srv.SetGroupMask, self._on_set_group_mask),
            "upload_trajectory": (srv.UploadTrajectory, self._on_upload_trajectory),
            "upload_compressed_trajectory": (
                srv.UploadCompressedTrajectory,
                self._on_upload_compressed,
            ),
            "notify_setpoints_stop": (srv.NotifySetpointsStop, self._on_notify_setpoints_stop),
            "send_packet": (srv.sendPacket, self._on_send_packet),
        }
        setup = SetupServices(
            self._crazyflie, self._jobs, self._flight, self._emergency, self._mirror
        )
        offered.update(setup.services())
        for name, service_type in SERVICE_TYPES.items():
            offered[name] = service_type, partial(self._on_command, name, service_type)
        if self._crazyflie.address.is_radio:
            offered["reboot"] = Empty, self._on_reboot
        names = self._names.free(offered)
        for name, (service_type, callback) in offered.items():
            self._handle.advertise_service(names[name], service_type, callback)

    # At once.

    def _on_emergency(self, _):
        try:
            self._emergency.latch()
        except CrazyflieError as error:
            text = f"emergency stop may not have arrived, is sent when the link is back: {error}"
            self._handle.error(f"{self._name}: {text}")
            raise ServiceError(text) from None
        self._handle.error(
            f"{self._name}: emergency stop; to fly again remove the vehicle, restart it and add "
            "it again"
        )
        return EmptyResponse()

    def _on_notify_setpoints_stop(self, request):
        try:
            self._commands.notify(request.remainValidMillisecs)
        except CrazyflieError as error:
            raise ServiceError(str(error)) from None
        return srv.NotifySetpointsStopResponse()

    def _on_send_packet(self, request):
        packet = request.packet
        data = bytes(packet.data)
        if packet.size > len(data):
            raise ServiceError(f"size is {packet.size}; a packet has at most {len(data)} bytes")
        port, channel = packet.header >> 4, packet.header & 3
        try:
            self._crazyflie.send_packet(port, channel, data[: packet.size])
        except CrazyflieError as error:
            raise ServiceError(str(error)) from None
        return srv.sendPacketResponse()

    # As jobs.

    def _on_command(self, name, service_type, request):
        return self._commands.send(requested(name, request), service_type._response_class())

    def _on_arm(self, request):
        def work(_):
            try:
                if request.data:
                    self._emergency.refuse()
                self._crazyflie.supervisor.arm(request.data)
                if request.data:
                    self._gate.handle(Event.FLIGHT_CALLED)
            except (CrazyflieError, ServiceError) as error:
                return SetBoolResponse(False, str(error))
            return SetBoolResponse(True, "armed" if request.data else "disarmed")

        return self._jobs.submit("arming", work)

    def _on_update_params(self, request):
        return self._submit("update_params", srv.UpdateParams, self._mirror.write, request.params)

    def _on_set_group_mask(self, request):
        set_mask = self._crazyflie.high_level.set_group_mask
        return self._submit("set_group_mask", srv.SetGroupMask, set_mask, request.groupMask)

    def _on_reboot(self, _):
        return self._submit("reboot", Empty, self._reboot)

    def _submit(self, name, service_type, call, *arguments):
        def work(_):
            call(*arguments)
            return service_type._response_class()

        return self._jobs.submit(name, work)

    def _on_upload_trajectory(self, request):
        pieces = [
            PolynomialPiece(
                piece.duration.to_sec(), piece.poly_x, piece.poly_y, piece.poly_z, piece.poly_yaw
            )
            for piece in request.pieces
        ]

        def work(job):
            trajectories = self._crazyflie.trajectories.guarded(lambda: job.is_valid)
            trajectories.upload(request.trajectoryId, request.pieceOffset, pieces, job.check)
            return srv.UploadTrajectoryResponse()

        return self._jobs.submit("upload_trajectory", work, is_flight=True)

    def _on_upload_compressed(self, request):
        start = (request.start.x, request.start.y, request.start.z, request.startYaw)
        segments = [
            (each.duration.to_sec(), each.x, each.y, each.z, each.yaw) for each in request.segments
        ]

        def work(job):
            trajectories = self._crazyflie.trajectories.guarded(lambda: job.is_valid)
            trajectories.upload_compressed(
                request.trajectoryId, request.offset, start, segments, job.check
            )
            return srv.UploadCompressedTrajectoryResponse()

        return self._jobs.submit("upload_compressed_trajectory", work, is_flight=True)

    def _reboot(self):
        try:
            state = self._flight.read()
        except LinkLostError:
            state = None
        if state is None:
            raise ServiceError(
                "no reboot: it is not known whether the vehicle flies, and it would fall; on the "
                "ground, remove the vehicle and call `rosrun crazyflie_tools reboot --uri "
                f"{self._crazyflie.address.uri}`"
            )
        if state & (SupervisorState.FLYING | SupervisorState.HIGH_LEVEL_ACTIVE):
            raise ServiceError(
                "no reboot: the vehicle flies (until 2 s after a landing it says so) and would "
                f"fall; its state is: {state.words()}"
            )
        self._crazyflie.reboot()
