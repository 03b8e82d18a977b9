"""A USB bus with one socket for a dongle."""

from crazyflie_link.testing import Dongle

PLACES = ((10, 0xE7), (20, 0xE7), (30, 0x01), (30, 0x02))
"""Channels, and last bytes of the addresses, of vehicles."""


class Bus:
    """Dongles reach vehicles, by their places."""

    def __init__(self, vehicles):
        self.vehicles = vehicles
        self.dongle = None
        self.failed_attempts = 0

    def plug_in(self):
        """Plug in a new dongle."""
        self.dongle = Dongle({place: each.port for place, each in self.vehicles.items()})

    def break_it(self):
        """Break the dongle, which answers no request any more and stays plugged in."""
        self.dongle.is_broken = True

    def devices(self, serial=None):
        """Return the dongle, as cflib looks for devices."""
        self.failed_attempts += self.dongle is None
        return [self.dongle] if self.dongle is not None else []
