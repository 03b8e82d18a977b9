"""Virtual vehicles on one radio channel, in simulated time."""

from random import Random
from typing import Any

from crazyflie_virtual.link.radio import RadioChannel
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle

SPACING = 1.0  #: Between two vehicles, m.


class RadioSwarm:
    """Vehicles with the addresses 1, 2, ..., side by side along y.

    Each misses broadcasts with a probability ``loss``. Their clocks are the channel's.
    """

    def __init__(self, vehicles: int, channel: RadioChannel, loss: float = 0.0, seed: int = 0):
        self.channel = channel
        self._loss = loss
        self._random = Random(seed)
        self.vehicles = [self._vehicle(number) for number in range(1, vehicles + 1)]

    @staticmethod
    def _vehicle(number: int) -> VirtualVehicle:
        settings: dict[str, Any] = {
            "address": number,
            "init_y": SPACING * number,
            "positioning": "none",
        }
        return VirtualVehicle(VehicleSettings(**settings))

    def broadcast(self, time: float, datagram: bytes) -> dict[int, tuple[float, list[bytes]]]:
        """Send a packet to all from ``time`` (s) on.

        Returns, for the address of each vehicle that has received it, when (s), and its answers.
        """
        arrival = self.channel.broadcast(time, len(datagram))
        received = {}
        for number, vehicle in enumerate(self.vehicles, start=1):
            vehicle.advance_to(arrival)
            if self._random.random() >= self._loss:
                received[number] = (arrival, vehicle.receive(datagram))
        return received
