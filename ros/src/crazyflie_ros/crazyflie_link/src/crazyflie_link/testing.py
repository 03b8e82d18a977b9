"""Support for tests: a Crazyradio below cflib's radio driver, and files of base stations."""

import socket
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

import usb
from cflib.crazyflie.mem import LighthouseBsCalibration, LighthouseBsGeometry
from cflib.drivers import crazyradio
from cflib.localization import LighthouseConfigFileManager

from crazyflie_link.cflib_internals import BROADCAST_ADDRESS

Place = tuple[int, int]  #: Channel, and last byte of the address, of a vehicle.

NULL = 0xF3
LINK_BITS = 3 << 2


class Dongle:
    """A USB device that passes packets on to vehicles, by their places.

    ``ports`` are their UDP ports of this machine.
    As the real one it gives no answer, and sends to all of the channel, if acknowledgements are
    off and the address is that of broadcasts.
    """

    bcdDevice = 0x0053  # noqa: N815

    def __init__(self, ports: Mapping[Place, int]):
        self._peers = ports
        self._sockets: dict[Place, socket.socket] = {}
        self._channel, self._acknowledges = 2, True
        self._address: tuple[int, ...] = (0xE7,) * 5
        self._answer: bytes | None = None
        self.is_broken = False

    def set_configuration(self, number: int) -> None:
        """Do nothing, unless it is broken."""
        self._check()

    def reset(self) -> None:
        """Do nothing, unless it is broken."""
        self._check()

    def ctrl_transfer(  # noqa: D102
        self,
        kind: int,
        request: int,
        wValue: int,  # noqa: N803
        wIndex: int,  # noqa: N803
        timeout: float,
        data_or_wLength: Sequence[int],  # noqa: N803
    ) -> None:
        self._check()
        if request == crazyradio.SET_RADIO_CHANNEL:
            self._channel = wValue
        elif request == crazyradio.SET_RADIO_ADDRESS:
            self._address = tuple(data_or_wLength)
        elif request == crazyradio.ACK_ENABLE:
            self._acknowledges = bool(wValue)

    def write(self, endpoint: int, data: Sequence[int], timeout: float) -> None:
        """Pass a packet on, and keep the answer for `read`."""
        assert endpoint == 1
        self._check()
        if not self._acknowledges:
            assert self._address == BROADCAST_ADDRESS
            for place in self._peers:
                if place[0] == self._channel:
                    self._link(place).send(bytes([data[0] & ~LINK_BITS, *data[1:]]))
            return
        place = (self._channel, self._address[-1])
        if place not in self._peers:
            self._answer = b"\0"
            return
        link = self._link(place)
        if data[0] & NULL != NULL:
            # Bits that cflib's numbering of packets clears.
            link.send(bytes([data[0] | LINK_BITS, *data[1:]]))
        try:
            self._answer = b"\1" + link.recv(64)
        except BlockingIOError:
            self._answer = b"\1"
            # A real one needs about so long.
            time.sleep(0.001)

    def _link(self, place):
        if place not in self._sockets:
            link = self._sockets[place] = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            link.connect(("127.0.0.1", self._peers[place]))
            link.setblocking(False)
        return self._sockets[place]

    def read(self, endpoint: int, size: int, timeout: float) -> bytes:
        """Return the answer to the last packet."""
        self._check()
        answer, self._answer = self._answer, None
        if answer is None:
            raise usb.USBTimeoutError("nothing to read")
        return answer

    def _check(self):
        if self.is_broken:
            raise usb.USBError("No such device (it may have been disconnected)", errno=19)


def write_lighthouse_file(path: Path, *numbers: int, system_type: int = 2) -> str:
    """Write the base stations of these numbers as cflib does, and return the path.

    Station k is at (1, 2, 2 + k), m; its calibration has the identifier 1000 + k.
    """
    geometries, calibrations = {}, {}
    for number in numbers:
        geometry, calibration = LighthouseBsGeometry(), LighthouseBsCalibration()
        geometry.origin, geometry.valid = [1.0, 2.0, 2.0 + number], True
        calibration.uid, calibration.valid = 1000 + number, True
        geometries[number], calibrations[number] = geometry, calibration
    LighthouseConfigFileManager.write(str(path), geometries, calibrations, system_type)
    return str(path)
