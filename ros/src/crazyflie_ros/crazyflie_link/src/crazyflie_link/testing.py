"""Support for tests: a Crazyradio below cflib's radio driver, and files of base stations."""

import socket
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import usb
from cflib.crazyflie.mem import LighthouseBsCalibration, LighthouseBsGeometry
from cflib.drivers import crazyradio
from cflib.localization import LighthouseConfigFileManager

from crazyflie_link.cflib_internals import BROADCAST_ADDRESS

Place = tuple[int, int]  #: Channel, and last byte of the address, of a vehicle.

NULL = 0xF3
LINK_BITS = 3 << 2
_UP, _DOWN = 1 << 3, 1 << 2  #: Bits of the numbers of packets, which alternate, in both directions.
_SAFELINK = 0x05  #: First byte of the request for numbered packets; the second one is on or off.


class RadioChip:
    """The radio chip of a vehicle, behind which its processor is a UDP port of this machine.

    Source: the behaviour of crazyflie2-nrf-firmware. With safelink, on at request, a packet with
    the number of the one before is acknowledged and dropped: it was sent again because the
    acknowledgement was lost. So is the data that comes back sent again, until its arrival is
    confirmed.
    """

    def __init__(self, port: int):
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.connect(("127.0.0.1", port))
        self.link.setblocking(False)
        self.has_safelink = False
        self._up = self._down = 0
        self._answer = b""

    def exchange(self, data: bytes) -> bytes:
        """Return what comes with the acknowledgement of a packet."""
        if data[0] & NULL == NULL and data[1:2] == bytes([_SAFELINK]) and len(data) == 3:
            self.has_safelink = bool(data[2])
            self._up, self._down, self._answer = _UP, _DOWN, b""
            return data
        is_new = not self.has_safelink or data[0] & _UP != self._up
        is_confirmed = not self.has_safelink or data[0] & _DOWN != self._down
        self._up, self._down = data[0] & _UP, data[0] & _DOWN
        if is_new and (data[0] & NULL != NULL or len(data) > 1):
            # Bits of the numbers.
            self.link.send(bytes([data[0] | LINK_BITS, *data[1:]]))
        if is_confirmed:
            self._answer = self._receive()
        if not self.has_safelink or not self._answer:
            return self._answer
        return bytes([self._answer[0] & ~_DOWN | self._down, *self._answer[1:]])

    def _receive(self):
        try:
            return self.link.recv(64)
        except BlockingIOError:
            # A real one needs about so long.
            time.sleep(0.001)
            return bytes([NULL]) if self.has_safelink else b""


class Dongle:
    """A USB device that passes packets on to vehicles, by their places.

    ``ports`` are their UDP ports of this machine. ``silent`` are places where no vehicle hears;
    ``lose()`` returns whether the next acknowledgement is lost.
    As the real one it gives no answer, and sends to all of the channel, if acknowledgements are
    off and the address is that of broadcasts.
    """

    bcdDevice = 0x0053  # noqa: N815

    def __init__(self, ports: Mapping[Place, int]):
        self.chips = {place: RadioChip(port) for place, port in ports.items()}
        self.silent: set[Place] = set()
        self.lose: Callable[[], bool] = lambda: False
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
            for (channel, _), chip in self.chips.items():
                if channel == self._channel:
                    chip.link.send(bytes([data[0] & ~LINK_BITS, *data[1:]]))
            return
        place = (self._channel, self._address[-1])
        self._answer = b"\0"
        if place not in self.chips or place in self.silent:
            # It is tried again and again; a real one needs about so long.
            time.sleep(0.001)
            return
        answer = self.chips[place].exchange(bytes(data))
        if not self.lose():
            self._answer = b"\1" + answer

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
