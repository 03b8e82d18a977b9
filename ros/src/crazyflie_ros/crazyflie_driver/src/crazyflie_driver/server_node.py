"""The driver: a server that vehicles are added to and removed from, and commands to all of them."""

import contextlib
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import Future, wait
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Empty, Header
from std_srvs import srv as std_srvs
from typing_extensions import override

from crazyflie_driver.commands import SERVICE_TYPES, Command, Need, requested
from crazyflie_driver.driver_parameters import (
    ADD,
    REMOVE,
    BroadcastParameters,
    CrazyflieServerParameters,
    VehicleParameters,
)
from crazyflie_driver.flight_commands import Reason
from crazyflie_driver.setpoint_topics import CMD_VEL
from crazyflie_driver.srv import AddCrazyflie, RemoveCrazyflie
from crazyflie_driver.status import diagnostics
from crazyflie_driver.vehicle import DriverVehicle
from crazyflie_driver.vehicle_base import Job
from crazyflie_driver.vehicle_link import radio_channel
from crazyflie_link.address import Address
from crazyflie_link.errors import AddressError, CrazyflieError, LinkLostError
from crazyflie_utils import Node, NodeHandle, ServiceError
from crazyflie_utils.context import are_related
from crazyflie_utils.refusal import refusals_text

_DIAGNOSTICS_PERIOD = 1.0
_FLIGHTS_PERIOD = 0.2
#: Time limit of the removal of all vehicles at the end of the server, and of a landing in it, s: a
#: vehicle goes on landing without a link.
_SHUTDOWN_LIMIT, _LANDING_LIMIT = 1.5, 0.5

_GO_TO = ("go_to", "go_to_linear")
ANSWER_LIMIT = 5.0  #: Time limit of all vehicles' answers, s; their own limits are shorter.


class Channel:
    """Broadcasts to vehicles on one channel, by the dongle of the address that it is made with.

    Vehicles with links of other dongles are also reached. External poses of vehicles on a radio are
    packed if the vehicles are as many as the parameters say; packed poses are not acknowledged, so
    vehicles of another dongle, which may be out of reach of this one, get their own.
    """

    def __init__(self, handle: NodeHandle, address: Address, parameters: BroadcastParameters):
        self.vehicles: list[DriverVehicle] = []
        self._dongle = address.dongle
        #: Sender to all of them; see `radio_channel`.
        self.radio = radio_channel(
            handle, address, self.vehicles, parameters.repeats, parameters.repeat_period
        )
        self._least_poses = parameters.poses

    def add(self, vehicle: DriverVehicle) -> None:
        """Add a vehicle."""
        self.vehicles.append(vehicle)
        vehicle.status.radio = self.radio
        self._share_poses()

    def remove(self, vehicle: DriverVehicle) -> None:
        """Remove a vehicle."""
        self.vehicles.remove(vehicle)
        self._share_poses()

    def share(self, needs: Mapping[DriverVehicle, Need]) -> Any:
        """Return a `SharedCommand` for all that need a command; None if each gets its own.

        A broadcast reaches every vehicle of the channel: each must be known, and must need nothing
        else.
        """
        ready = [vehicle for vehicle in self.vehicles if needs.get(vehicle) is Need.COMMAND]
        harmless = (Need.COMMAND, Need.NOT_ADDRESSED)
        if len(ready) < 2 or any(needs.get(each) not in harmless for each in self.vehicles):
            return None
        # Older firmware has other forms of the commands.
        if len(set(self._protocols())) != 1:
            return None
        return self.radio.share(len(ready))

    def _share_poses(self):
        addresses = [vehicle.crazyflie.address for vehicle in self.vehicles]
        users = Counter(address.vehicle_id for address in addresses)
        # Each vehicle on the channel uses the poses with its id, from any dongle.
        packed = {
            vehicle: address.vehicle_id
            for vehicle, address in zip(self.vehicles, addresses, strict=True)
            if address.dongle == self._dongle and users[address.vehicle_id] == 1
        }
        shares = 0 < self._least_poses <= len(addresses)
        self.radio.pack_poses(len(packed))
        for vehicle in self.vehicles:
            vehicle_id = packed.get(vehicle)
            localization = vehicle.crazyflie.localization
            if shares and vehicle_id is not None:
                localization.broadcast_by(self.radio.poses, vehicle_id)
            else:
                localization.broadcast_by(None)

    def _protocols(self):
        for vehicle in self.vehicles:
            with contextlib.suppress(LinkLostError):
                yield vehicle.crazyflie.protocol()


class CrazyflieServerNode(Node[CrazyflieServerParameters]):
    """Connect to vehicles side by side, and serve each until it is removed.

    A service for all vehicles, ``~all/NAME``, is offered for each high-level command. All checks
    for a single vehicle are made for each, before any is sent the command; a landing or stop is
    sent to all others when it fails for one. A radio channel gets one packet for all if each of its
    vehicles needs just that; otherwise each vehicle gets its own. Every vehicle must answer; one
    that has not received the broadcast is sent its own command.
    """

    effects = "its vehicles, by their links"

    needed_in_flight = True

    def __init__(self) -> None:
        # By the key of the address, and by its channel.
        self._vehicles: dict[str, DriverVehicle] = {}
        self._channels: dict[str, Channel] = {}
        self._in_flight = False
        self._is_shutting_down = False

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        handle.advertise_service(ADD, AddCrazyflie, self._on_add)
        handle.advertise_service(REMOVE, RemoveCrazyflie, self._on_remove)
        for name, service_type in SERVICE_TYPES.items():
            handle.advertise_service(f"~all/{name}", service_type, partial(self._on_command, name))
        handle.advertise_service("~all/emergency", std_srvs.Empty, self._on_emergency)
        handle.subscribe(self._parameters.emergency_topic, Empty, self._on_emergency)
        self._request_landing = handle.advertise_landing_request()
        self._inhibit_shutdown = handle.inhibit_shutdown(self._on_end_of_node)
        handle.timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        handle.timer(_FLIGHTS_PERIOD, self._follow_flights)

    @override
    def prepare_shutdown(self) -> None:
        self._is_shutting_down = True
        self._request_landing()
        self._follow_flights()

    def shutdown(self) -> None:
        """Land vehicles in the air, stop the motors of all others, disconnect from all."""
        removed = [vehicle.remove(_LANDING_LIMIT) for vehicle in list(self._vehicles.values())]
        self._handle.outside(wait, removed, _SHUTDOWN_LIMIT)
        for channel in list(self._channels.values()):
            channel.radio.close()

    def _follow_flights(self):
        vehicles = self._vehicles.values()
        flying = [each for each in vehicles if each.commands.is_high_level_flight_active]
        # A flight on thrust is ended by the node that streams it.
        in_flight = bool(flying) or any(each.setpoints.is_flown_on_thrust for each in vehicles)
        if in_flight != self._in_flight:
            self._in_flight = in_flight
            self._inhibit_shutdown(in_flight)
        if self._is_shutting_down:
            for each in flying:
                each.commands.land(Reason.SHUTDOWN)

    def _on_end_of_node(self, name):
        for each in self._vehicles.values():
            if each.commands.is_high_level_flight_active and are_related(
                name, f"{each.parameters.prefix}/"
            ):
                each.commands.land(Reason.NEEDED_NODE)

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
            self._channels[address.channel] = Channel(
                self._handle, address, self._parameters.broadcast
            )
        self._channels[address.channel].add(vehicle)
        vehicle.info(f"connecting to {requested.uri}")
        return self._when_done(vehicle.connect(), self._finish_adding, vehicle)

    def _finish_adding(self, vehicle, done):
        if done.exception() is not None:
            self._forget(vehicle)
        done.result()

    def _on_remove(self, request):
        vehicle = None
        with contextlib.suppress(AddressError):
            vehicle = self._vehicles.get(Address.parse(request.uri).key)
        if vehicle is None:
            known = ", ".join(each.parameters.uri for each in self._vehicles.values()) or "none"
            raise ServiceError(f"no vehicle {request.uri!r} has been added; known: {known}")
        if vehicle.is_closing():
            raise ServiceError(f"{request.uri} is being removed already")
        if vehicle.setpoints.is_flown_on_thrust:
            raise ServiceError(
                f"{request.uri} flies on the thrust of {vehicle.parameters.prefix}/{CMD_VEL}, and "
                "would fall: land first, or end that stream"
            )
        removed = vehicle.remove(self._parameters.landing_limit)
        return self._when_done(removed, self._finish_removing, vehicle)

    def _finish_removing(self, vehicle, done):
        self._forget(vehicle)
        if problem := done.result():
            raise ServiceError(f"{vehicle.parameters.uri} is removed, but {problem}")
        vehicle.info("removed")

    def _on_command(self, name, request):
        if name in _GO_TO and not request.relative:
            raise ServiceError(
                f"{name} of all vehicles: relative is False, and they cannot go to one place; "
                "expected True"
            )
        command = requested(name, request)
        channels = list(self._channels.values())
        ready = [each for channel in channels for each in channel.vehicles if each.is_ready()]
        if not ready:
            raise ServiceError(f"{name} of all vehicles: none is connected; expected one or more")
        # Started here, in the order of the calls.
        checks = {vehicle: vehicle.commands.check(command) for vehicle in ready}
        before = {vehicle: vehicle.jobs.superseded for vehicle in ready}
        job = Job(lambda _: self._send(command, channels, checks, before))
        return job.start(self._handle.task, f"all-{name}")

    def _send(
        self,
        command: Command,
        channels: list[Channel],
        checks: Mapping[DriverVehicle, Future[Need]],
        before: Mapping[DriverVehicle, tuple[int, str]],
    ) -> None:
        needs, refusals = self._results(checks, not command.ends_flight)
        if not command.ends_flight:
            # While others were checked, a vehicle may have been landed.
            for vehicle in needs:
                if vehicle.jobs.superseded != before[vehicle]:
                    _, reason = vehicle.jobs.superseded
                    refusals[vehicle.parameters.name] = f"given up for {reason}"
            if refusals:
                text = refusals_text(refusals, len(checks))
                raise ServiceError(f"{command.name} was sent to no vehicle: {text}")
        sent = {}
        for channel in channels:
            shared = channel.share(needs)
            for vehicle in channel.vehicles:
                if vehicle in needs:
                    own = command.by(shared if needs[vehicle] is Need.COMMAND else None)
                    sent[vehicle] = vehicle.commands.send(own)
        refusals.update(self._results(sent, not command.ends_flight)[1])
        if refusals:
            raise ServiceError(f"{command.name}: {refusals_text(refusals, len(checks))}")

    def _results(
        self, futures: Mapping[DriverVehicle, Future[Any]], may_withdraw: bool
    ) -> tuple[dict[DriverVehicle, Any], dict[str, str]]:
        # Results; errors by name.
        self._handle.outside(wait, list(futures.values()), ANSWER_LIMIT)
        results: dict[DriverVehicle, Any] = {}
        errors: dict[str, str] = {}
        for vehicle, future in futures.items():
            # A refused command must not be carried out later.
            if future.cancel() if may_withdraw else not future.done():
                errors[vehicle.parameters.name] = f"no answer within {ANSWER_LIMIT:g} s"
            elif (error := future.exception()) is not None:
                errors[vehicle.parameters.name] = str(error)
            else:
                results[vehicle] = future.result()
        return results, errors

    def _on_emergency(self, _):
        # A broadcast reaches all at once; then each is sent its own until it has obeyed.
        for channel in self._channels.values():
            channel.radio.stop_motors()
        for vehicle in self._vehicles.values():
            try:
                vehicle.latch_emergency()
            except CrazyflieError as error:
                vehicle.error(f"emergency stop, sent when there is a link: {error}")
            else:
                vehicle.error("emergency stop of all vehicles")

    def _forget(self, vehicle: DriverVehicle) -> None:
        address = vehicle.crazyflie.address
        if self._vehicles.get(address.key) is vehicle:
            del self._vehicles[address.key]
            name = address.channel
            self._channels[name].remove(vehicle)
            if not self._channels[name].vehicles:
                self._channels.pop(name).radio.close()

    def _when_done(self, done, finish, vehicle):
        # ``finish`` runs in its turn with the other callbacks, before the answer goes out.
        answer = Job(lambda _: finish(vehicle, done))
        done.add_done_callback(lambda _: self._handle.submit(answer.run))
        return answer.done

    def _publish_diagnostics(self):
        component = self._handle.name.strip("/")
        self._diagnostics.publish(
            DiagnosticArray(
                header=Header(stamp=self._handle.stamp()),
                status=[
                    diagnostics(
                        vehicle.status.status(),
                        f"{component}: {vehicle.parameters.name}",
                        vehicle.parameters.uri,
                        self._parameters.link,
                    )
                    for vehicle in self._vehicles.values()
                ],
            )
        )
