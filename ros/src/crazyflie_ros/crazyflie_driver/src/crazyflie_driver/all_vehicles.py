"""The vehicles of the server by radio channel, and services that command all of them at once."""

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, wait
from functools import partial
from typing import Any

from crazyflie_driver.commands import SERVICE_TYPES, Command, Need, requested
from crazyflie_driver.jobs import Job
from crazyflie_driver.parameters import BroadcastParameters
from crazyflie_driver.vehicle import DriverVehicle
from crazyflie_link.address import Address
from crazyflie_link.broadcast import Broadcaster, SharedCommand
from crazyflie_link.errors import LinkLostError
from crazyflie_link.link import Link
from crazyflie_link.localization import PackedPoses
from crazyflie_utils import NodeHandle, ServiceError


class Channel:
    """Broadcasts to vehicles on one channel, by the dongle of the address that it is made with.

    Vehicles with links of other dongles are also reached. External poses of vehicles on a radio are
    packed if the vehicles are as many as the parameters say; packed poses are not acknowledged, so
    vehicles of another dongle, which may be out of reach of this one, get their own.
    """

    def __init__(self, address: Address, parameters: BroadcastParameters):
        self.vehicles: list[DriverVehicle] = []
        self._dongle = address.dongle
        self.broadcaster = Broadcaster(
            address, self._links, parameters.repeats, parameters.repeat_period
        )
        self._poses = PackedPoses(self.broadcaster)
        self._least_poses = parameters.poses

    def add(self, vehicle: DriverVehicle) -> None:
        """Add a vehicle."""
        self.vehicles.append(vehicle)
        vehicle.status.broadcaster = self.broadcaster
        self._share_poses()

    def remove(self, vehicle: DriverVehicle) -> None:
        """Remove a vehicle."""
        self.vehicles.remove(vehicle)
        self._share_poses()

    def close(self) -> None:
        """Stop broadcasting."""
        self.broadcaster.close()

    def share(self, needs: Mapping[DriverVehicle, Need]) -> SharedCommand | None:
        """Return a command for all vehicles with the need for one; None if each gets its own.

        A broadcast reaches every vehicle of the channel: each must be known, and must need nothing
        else.
        """
        ready = [vehicle for vehicle in self.vehicles if needs.get(vehicle) is Need.COMMAND]
        harmless = (Need.COMMAND, Need.NOT_ADDRESSED)
        if len(ready) < 2 or any(needs.get(each) not in harmless for each in self.vehicles):
            return None
        # Older firmware has other forms of the commands.
        if len({link.protocol for link in self._links()}) != 1:
            return None
        return SharedCommand(self.broadcaster, len(ready))

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
        self._poses.vehicles = len(packed)
        for vehicle in self.vehicles:
            vehicle_id = packed.get(vehicle)
            localization = vehicle.crazyflie.localization
            if shares and vehicle_id is not None:
                localization.broadcast_by(self._poses, vehicle_id)
            else:
                localization.broadcast_by(None)

    def _links(self) -> Iterator[Link]:
        for vehicle in list(self.vehicles):
            with contextlib.suppress(LinkLostError):
                yield vehicle.crazyflie.link()


_GO_TO = ("go_to", "go_to_linear")

LIMIT = 5.0  #: Time limit of the vehicles' answers, s; their own limits are shorter.


class AllVehicles:
    """Offers a service for all vehicles for each high-level command.

    All checks for a single vehicle are made for each, before any is sent the command; a
    landing or stop is sent to all others when it fails for one. A radio channel gets one
    packet for all if each of its vehicles needs just that; otherwise each vehicle gets its own.
    Every vehicle must answer; one that has not received the broadcast is sent its own command.
    """

    def __init__(self, handle: NodeHandle, channels: Mapping[str, Channel]):
        self._handle = handle
        self._channels = channels

    def advertise(self) -> None:
        """Offer the services, ``~all/NAME``."""
        for name, service_type in SERVICE_TYPES.items():
            callback = partial(self._on_command, name, service_type._response_class())
            self._handle.advertise_service(f"~all/{name}", service_type, callback)

    def _on_command(self, name, response, request):
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

        def work(_: Job) -> Any:
            self._send(command, channels, checks)
            return response

        return Job(work).start(f"all-{name}")

    def _send(
        self,
        command: Command,
        channels: list[Channel],
        checks: Mapping[DriverVehicle, Future[Need]],
    ) -> None:
        needs, refusals = _results(checks, not command.ends_flight)
        if refusals and not command.ends_flight:
            raise ServiceError(
                f"{command.name} was sent to no vehicle: {_text(refusals, len(checks))}"
            )
        sent = {}
        for channel in channels:
            shared = channel.share(needs)
            for vehicle in channel.vehicles:
                if vehicle in needs:
                    is_shared = shared is not None and needs[vehicle] is Need.COMMAND
                    own = command.by(shared if is_shared else None)
                    sent[vehicle] = vehicle.commands.send(own, None)
        refusals.update(_results(sent, not command.ends_flight)[1])
        if refusals:
            raise ServiceError(f"{command.name}: {_text(refusals, len(checks))}")


def _results(
    futures: Mapping[DriverVehicle, Future[Any]], may_withdraw: bool
) -> tuple[dict[DriverVehicle, Any], dict[DriverVehicle, str]]:
    # Results and errors.
    wait(futures.values(), LIMIT)
    results: dict[DriverVehicle, Any] = {}
    errors: dict[DriverVehicle, str] = {}
    for vehicle, future in futures.items():
        # A refused command must not be carried out later.
        if future.cancel() if may_withdraw else not future.done():
            errors[vehicle] = f"no answer within {LIMIT:g} s"
        elif (error := future.exception()) is not None:
            errors[vehicle] = str(error)
        else:
            results[vehicle] = future.result()
    return results, errors


def _text(refusals: Mapping[DriverVehicle, str], count: int) -> str:
    texts = sorted(f"{vehicle.name}: {text}" for vehicle, text in refusals.items())
    return f"{len(texts)} of {count} vehicles: " + "; ".join(texts)
