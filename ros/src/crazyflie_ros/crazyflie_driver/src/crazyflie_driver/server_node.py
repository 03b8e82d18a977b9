"""The driver: a server that vehicles are added to and removed from."""

import contextlib
from concurrent.futures import Future, wait
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Empty, Header
from std_srvs import srv as std_srvs
from typing_extensions import override

from crazyflie_driver.all_vehicles import AllVehicles, Channel
from crazyflie_driver.flight_commands import Reason
from crazyflie_driver.parameters import CrazyflieServerParameters, VehicleParameters
from crazyflie_driver.srv import (
    AddCrazyflie,
    AddCrazyflieResponse,
    RemoveCrazyflie,
    RemoveCrazyflieResponse,
)
from crazyflie_driver.status import diagnostics
from crazyflie_driver.vehicle import DriverVehicle
from crazyflie_link.address import Address
from crazyflie_link.errors import AddressError, CrazyflieError
from crazyflie_link.supervisor import BROADCAST_STOP
from crazyflie_utils import Node, NodeHandle, ServiceError

ADD, REMOVE = "/add_crazyflie", "/remove_crazyflie"  #: Services of the server.

_DIAGNOSTICS_PERIOD = 1.0
_FLIGHTS_PERIOD = 0.2
#: Time limit of the removal of all vehicles at the end of the server, and of a landing in it, s: a
#: vehicle goes on landing without a link.
_SHUTDOWN_LIMIT, _LANDING_LIMIT = 1.5, 0.5


class CrazyflieServerNode(Node):
    """Connect to vehicles side by side, and serve each until it is removed."""

    needed_in_flight = True

    def __init__(self) -> None:
        # By the key of the address, and by its channel.
        self._vehicles: dict[str, DriverVehicle] = {}
        self._channels: dict[str, Channel] = {}
        self._in_flight = False
        self._is_shutting_down = False

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(CrazyflieServerParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        handle.advertise_service(ADD, AddCrazyflie, self._on_add)
        handle.advertise_service(REMOVE, RemoveCrazyflie, self._on_remove)
        AllVehicles(handle, self._channels).advertise()
        handle.advertise_service("~all/emergency", std_srvs.Empty, self._on_emergency)
        handle.subscribe(self._parameters.emergency_topic, Empty, self._on_emergency)
        self._inhibit_shutdown = handle.inhibit_shutdown()
        handle.timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        handle.timer(_FLIGHTS_PERIOD, self._follow_flights)

    @override
    def prepare_shutdown(self) -> None:
        self._is_shutting_down = True
        self._follow_flights()

    def shutdown(self) -> None:
        """Land vehicles in the air, stop the motors of all others, disconnect from all."""
        wait(
            [vehicle.remove(_LANDING_LIMIT) for vehicle in list(self._vehicles.values())],
            _SHUTDOWN_LIMIT,
        )
        for channel in self._channels.values():
            channel.close()

    def _follow_flights(self):
        # Flights on setpoints are ended by the node that sends these.
        vehicles = self._vehicles.values()
        flying = [each for each in vehicles if each.commands.is_high_level_flight_active]
        if bool(flying) != self._in_flight:
            self._in_flight = bool(flying)
            self._inhibit_shutdown(self._in_flight)
        if self._is_shutting_down:
            for each in flying:
                each.commands.land(Reason.SHUTDOWN)

    def _on_add(self, request):
        requested = VehicleParameters.from_request(request)
        try:
            address = Address.parse(requested.uri)
        except CrazyflieError as error:
            self._handle.error(f"{requested.name}: {error}")
            raise ServiceError(str(error)) from None
        # Two links to one vehicle would displace each other.
        if (known := self._vehicles.get(address.key)) is not None:
            other = known.parameters
            spelled = "" if other.uri == requested.uri else f" ({other.uri})"
            raise ServiceError(f"{requested.uri} has been added already, as {other.name}{spelled}")
        for other in (vehicle.parameters for vehicle in self._vehicles.values()):
            if other.tf_prefix == requested.tf_prefix:
                raise ServiceError(
                    f"tf_prefix {other.tf_prefix!r} is in use by {other.uri}; choose another"
                )
        vehicle = DriverVehicle(self._handle, requested, self._parameters)
        self._vehicles[address.key] = vehicle
        if address.channel not in self._channels:
            self._channels[address.channel] = Channel(address, self._parameters.broadcast)
        self._channels[address.channel].add(vehicle)
        vehicle.info(f"connecting to {requested.uri}")
        return self._when_done(vehicle.connect(), self._finish_adding, vehicle)

    def _finish_adding(self, vehicle, done):
        if done.exception() is not None:
            self._forget(vehicle)
        return AddCrazyflieResponse()

    def _on_remove(self, request):
        vehicle = None
        with contextlib.suppress(AddressError):
            vehicle = self._vehicles.get(Address.parse(request.uri).key)
        if vehicle is None:
            known = ", ".join(each.parameters.uri for each in self._vehicles.values()) or "none"
            raise ServiceError(f"no vehicle {request.uri!r} has been added; known: {known}")
        if vehicle.is_closing():
            raise ServiceError(f"{request.uri} is being removed already")
        removed = vehicle.remove(self._parameters.landing_limit)
        return self._when_done(removed, self._finish_removing, vehicle)

    def _finish_removing(self, vehicle, done):
        self._forget(vehicle)
        if problem := done.result():
            raise ServiceError(f"{vehicle.parameters.uri} is removed, but {problem}")
        vehicle.info("removed")
        return RemoveCrazyflieResponse()

    def _on_emergency(self, _):
        # A broadcast reaches all at once; then each is sent its own until it has obeyed.
        for channel in self._channels.values():
            channel.broadcaster.send(BROADCAST_STOP, urgent=True)
        for vehicle in self._vehicles.values():
            try:
                vehicle.latch_emergency()
            except CrazyflieError as error:
                vehicle.error(f"emergency stop, sent when there is a link: {error}")
            else:
                vehicle.error("emergency stop of all vehicles")
        return std_srvs.EmptyResponse()

    def _forget(self, vehicle: DriverVehicle) -> None:
        address = vehicle.crazyflie.address
        if self._vehicles.get(address.key) is vehicle:
            del self._vehicles[address.key]
            name = address.channel
            self._channels[name].remove(vehicle)
            if not self._channels[name].vehicles:
                self._channels.pop(name).close()

    def _when_done(self, done, finish, vehicle):
        # ``finish`` runs in its turn with the other callbacks, before the answer goes out.
        answer: Future[Any] = Future()

        def finish_answer():
            try:
                response = finish(vehicle, done)
                done.result()
            except Exception as error:
                answer.set_exception(error)
            else:
                answer.set_result(response)

        done.add_done_callback(lambda _: self._handle.submit(finish_answer))
        return answer

    def _publish_diagnostics(self):
        component = self._handle.name.strip("/")
        self._diagnostics.publish(
            DiagnosticArray(
                header=Header(stamp=self._handle.stamp()),
                status=[
                    diagnostics(
                        vehicle.status.status(),
                        f"{component}: {vehicle.name}",
                        vehicle.parameters.uri,
                        self._parameters.link,
                    )
                    for vehicle in self._vehicles.values()
                ],
            )
        )
