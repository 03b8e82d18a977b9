"""Services of one vehicle."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from std_srvs.srv import Empty, EmptyResponse, SetBool, SetBoolResponse

from crazyflie_driver import srv
from crazyflie_driver.command import Command
from crazyflie_driver.service_names import ServiceNames
from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils import NodeHandle, ServiceError

if TYPE_CHECKING:
    from crazyflie_driver.vehicle import DriverVehicle


class VehicleServices:
    """Announce a vehicle's services and carry them out.

    What waits for the vehicle is done by its worker, where landing and stopping take the place of
    whatever was asked before; what does not, at once.

    Parameters
    ----------
    handle : NodeHandle
    vehicle : DriverVehicle

    Attributes
    ----------
    are_advertised : bool
    names : ServiceNames
        Where they are.
    """

    def __init__(self, handle: NodeHandle, vehicle: DriverVehicle):
        self.are_advertised = False
        self.names = ServiceNames(handle, vehicle.parameters.prefix)
        self._handle = handle
        self._vehicle = vehicle

    def advertise(self) -> None:
        """Offer all services that the vehicle has."""
        vehicle = self._vehicle
        offered = [
            ("emergency", Empty, self._emergency),
            ("arm", SetBool, self._arm),
            ("update_params", srv.UpdateParams, self._update_params),
            ("set_group_mask", srv.SetGroupMask, self._set_group_mask),
            ("takeoff", srv.Takeoff, self._takeoff),
            ("land", srv.Land, self._land),
            ("stop", srv.Stop, self._stop),
            ("go_to", srv.GoTo, self._go_to),
            ("upload_trajectory", srv.UploadTrajectory, self._upload_trajectory),
            ("start_trajectory", srv.StartTrajectory, self._start_trajectory),
            ("notify_setpoints_stop", srv.NotifySetpointsStop, self._notify_setpoints_stop),
            ("send_packet", srv.sendPacket, self._send_packet),
        ]
        if vehicle.crazyflie.address.is_radio:
            offered.append(("reboot", Empty, self._reboot))
        names = self.names.free(name for name, *_ in offered)
        for name, service_type, callback in offered:
            self._handle.advertise_service(names[name], service_type, callback)
        self.are_advertised = True

    # At once.

    def _emergency(self, _):
        try:
            self._vehicle.stop_in_emergency()
        except CrazyflieError as error:
            text = f"emergency stop may not have arrived, is sent when the link is back: {error}"
            self._handle.error(f"{self._vehicle.parameters.name}: {text}")
            raise ServiceError(text) from None
        self._handle.error(
            f"{self._vehicle.parameters.name}: emergency stop; to fly again remove the vehicle, "
            "restart it and add it again"
        )
        return EmptyResponse()

    def _notify_setpoints_stop(self, request):
        self._at_once(lambda: self._vehicle.commands.notify(request.remainValidMillisecs))
        return srv.NotifySetpointsStopResponse()

    def _send_packet(self, request):
        packet = request.packet
        data = bytes(packet.data)
        if packet.size > len(data):
            raise ServiceError(f"size is {packet.size}; a packet has at most {len(data)} bytes")
        self._at_once(
            lambda: self._vehicle.crazyflie.send_packet(
                packet.header >> 4, packet.header & 3, data[: packet.size]
            )
        )
        return srv.sendPacketResponse()

    @staticmethod
    def _at_once(send: Callable[[], None]) -> None:
        try:
            send()
        except CrazyflieError as error:
            raise ServiceError(str(error)) from None

    # By the worker.

    def _arm(self, request):
        vehicle = self._vehicle

        def work(_):
            try:
                if request.data:
                    vehicle.refuse_in_emergency()
                vehicle.crazyflie.supervisor.arm(request.data)
                if request.data:
                    vehicle.setpoints.gate.open()
            except (CrazyflieError, ServiceError) as error:
                return SetBoolResponse(False, str(error))
            return SetBoolResponse(True, "armed" if request.data else "disarmed")

        return vehicle.do("arming", work)

    def _update_params(self, request):
        def work(_):
            self._vehicle.write_parameters(request.params)
            return srv.UpdateParamsResponse()

        return self._vehicle.do("update_params", work)

    def _reboot(self, _):
        def work(_):
            self._refuse_to_reboot_in_flight()
            self._vehicle.crazyflie.reboot()
            return EmptyResponse()

        return self._vehicle.do("reboot", work)

    def _refuse_to_reboot_in_flight(self):
        try:
            state = self._vehicle.read_state()
        except LinkLostError:
            state = None
        if state is None:
            raise ServiceError(
                "no reboot: nothing tells whether the vehicle flies, and it would fall; on the "
                "ground, remove the vehicle and call `rosrun crazyflie_tools reboot --uri "
                f"{self._vehicle.parameters.uri}`"
            )
        if state & (SupervisorState.FLYING | SupervisorState.HIGH_LEVEL_ACTIVE):
            raise ServiceError(
                f"no reboot: the vehicle flies (until 2 s after a landing it says so) and would "
                f"fall; its state is: {state.words()}"
            )

    def _set_group_mask(self, request):
        def work(_):
            self._vehicle.crazyflie.high_level.set_group_mask(request.groupMask)
            return srv.SetGroupMaskResponse()

        return self._vehicle.do("set_group_mask", work)

    def _upload_trajectory(self, request):
        pieces = [
            PolynomialPiece(
                piece.duration.to_sec(), piece.poly_x, piece.poly_y, piece.poly_z, piece.poly_yaw
            )
            for piece in request.pieces
        ]

        def work(job):
            trajectories = self._vehicle.crazyflie.trajectories.guarded(lambda: job.is_valid)
            trajectories.upload(request.trajectoryId, request.pieceOffset, pieces, job.check)
            return srv.UploadTrajectoryResponse()

        return self._vehicle.do("upload_trajectory", work, is_flight=True)

    # High-level commands.

    def _takeoff(self, request):
        duration, mask = request.duration.to_sec(), request.groupMask
        return self._command(
            "takeoff",
            lambda high_level: high_level.take_off(request.height, duration, mask),
            duration,
            mask,
            srv.TakeoffResponse(),
        )

    def _land(self, request):
        duration = request.duration.to_sec()
        return self._vehicle.commands.land(
            request.height, duration, request.groupMask, srv.LandResponse()
        )

    def _stop(self, request):
        mask = request.groupMask
        return self._command(
            "stop", lambda high_level: high_level.stop(mask), 0.0, mask, srv.StopResponse()
        )

    def _go_to(self, request):
        duration, mask = request.duration.to_sec(), request.groupMask
        goal = (request.goal.x, request.goal.y, request.goal.z)
        return self._command(
            "go_to",
            lambda high_level: high_level.go_to(
                goal, request.yaw, duration, request.relative, mask
            ),
            duration,
            mask,
            srv.GoToResponse(),
        )

    def _start_trajectory(self, request):
        mask = request.groupMask
        return self._command(
            "start_trajectory",
            lambda high_level: high_level.start_trajectory(
                request.trajectoryId, request.timescale, request.relative, request.reversed, mask
            ),
            0.0,
            mask,
            srv.StartTrajectoryResponse(),
        )

    def _command(self, name, send, duration, group_mask, response):
        return self._vehicle.commands.send(Command(name, send, duration, group_mask), response)
