"""The vehicles of the server that a broadcast reaches: those on one radio channel and rate."""

import contextlib
from collections import Counter
from collections.abc import Iterator, Mapping

from crazyflie_driver.flight_commands import Need
from crazyflie_driver.server_parameters import BroadcastParameters
from crazyflie_driver.vehicle import DriverVehicle
from crazyflie_link.address import Address
from crazyflie_link.broadcast import Broadcaster, SharedCommand
from crazyflie_link.errors import LinkLostError
from crazyflie_link.link import Link
from crazyflie_link.localization import PackedPoses


class Channel:
    """Broadcasts to vehicles on one channel, by the dongle of the address that it is made with.

    A vehicle that is spoken to by another dongle is reached, too. External poses of vehicles on a
    radio are packed, if they are as many as the parameters say; nobody acknowledges them, so those
    of another dongle, which may be out of reach of this one, get their own.
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
        """Take a vehicle in."""
        self.vehicles.append(vehicle)
        vehicle.status.broadcaster = self.broadcaster
        self._share_poses()

    def remove(self, vehicle: DriverVehicle) -> None:
        """Leave a vehicle out."""
        self.vehicles.remove(vehicle)
        self._share_poses()

    def close(self) -> None:
        """Send nothing any more."""
        self.broadcaster.close()

    def share(self, needs: Mapping[DriverVehicle, Need]) -> SharedCommand | None:
        """Return a command for all vehicles with the need for one; None if each gets its own.

        A broadcast reaches every vehicle of the channel: each has to be known, and to need nothing
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
        # Each vehicle on the channel takes the poses with its id, whatever dongle speaks to it.
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
