"""The private names of cflib that this package uses, and what its radio driver leaves behind.

All vehicles of a dongle share one thread of cflib, which ends at an error of the USB device.
Every later send through it blocks for ever, and later connections are given the dead thread
again. An attempt to open a dongle that is absent leaves an entry that is never removed.
"""

import contextlib
import importlib
import queue
import re
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from cflib.crtp import radiodriver
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.radiodriver import RadioDriver, RadioManager
from cflib.drivers.crazyradio import Crazyradio
from typing_extensions import override

#: MODULE:CLASS.ATTRIBUTE; an attribute of the class, or one that its constructor sets.
PRIVATE_NAMES = (
    "cflib.crazyflie:Crazyflie._link_error_cb",
    "cflib.crazyflie:Crazyflie._platform_info_fetched",
    "cflib.crazyflie:Crazyflie._send_lock",
    "cflib.crazyflie.log:Log._err_codes",
    "cflib.crazyflie.mem:_WriteRequest.MAX_DATA_LENGTH",
    "cflib.crtp.radiodriver:RadioDriver._radio",
    "cflib.crtp.radiodriver:RadioDriver._thread",
    "cflib.crtp.radiodriver:RadioManager._lock",
    "cflib.crtp.radiodriver:RadioManager._radios",
    "cflib.crtp.radiodriver:_RadioCommands.SEND_PACKET",
    "cflib.crtp.radiodriver:_RadioDriverThread._sp",
    # The name by which it makes its dongles.
    "cflib.crtp.radiodriver:_SharedRadio.Crazyradio",
    "cflib.crtp.radiodriver:_SharedRadio._lock",
    "cflib.crtp.radiodriver:_SharedRadio._radio",
    "cflib.crtp.radiodriver:_SharedRadio._rsp_queues",
    "cflib.crtp.radiodriver:_SharedRadioInstance._cmd_queue",
    "cflib.crtp.radiodriver:_SharedRadioInstance._instance_id",
    "cflib.crtp.radiodriver:_SharedRadioInstance._rsp_queue",
)

#: Every vehicle listens to it as well as to its own address (crazyflie2-nrf-firmware).
BROADCAST_ADDRESS = (0xFF, 0xE7, 0xE7, 0xE7, 0xE7)

#: Between two broadcast packets, s: a vehicle hands one on to its main processor at 1 Mbit/s, with
#: 37 bytes of 10 bits in 0.37 ms; crazyflie_cpp keeps the same distance.
PACKET_GAP = 0.0005

#: Time limit of a broadcast in the dongle, s; cflib gives a packet 1 s.
_DONGLE_LIMIT = 2.0


def check_private_names(names: Iterable[str] = PRIVATE_NAMES) -> None:
    """Raise `ImportError` at the first name that the installed cflib does not have."""
    for name in names:
        module, _, path = name.partition(":")
        class_name, _, attribute = path.partition(".")
        owner = getattr(importlib.import_module(module), class_name, None)
        constructor = getattr(getattr(owner, "__init__", None), "__code__", None)
        set_there = constructor.co_names if constructor is not None else ()
        if not hasattr(owner, attribute) and attribute not in set_there:
            raise ImportError(
                f"cflib has no {name.replace(':', '.')}, which crazyflie_link uses: install the "
                f"version it was tested with, {pinned_version()}"
            )


def pinned_version() -> str:
    """Return the version in ros/requirements.txt, such as "cflib==0.1.34"."""
    for folder in Path(__file__).resolve().parents:
        with contextlib.suppress(OSError):
            text = (folder / "requirements.txt").read_text(encoding="utf-8")
            if found := re.search(r"^cflib==[\w.]+", text, re.MULTILINE):
                return found[0]
    # In an installed workspace.
    return "cflib of the workspace's ros/requirements.txt"


def forget_dead_radios() -> None:
    """Remove dongles whose thread has ended, or that have no user: cflib opens them again."""
    with RadioManager._lock:
        for devid, radio in enumerate(RadioManager._radios):
            if radio is None:
                continue
            if not radio.is_alive():
                RadioManager._radios[devid] = None
                if radio._radio is not None:
                    # The new owner cannot claim the device before. It is dead: what it raises, of
                    # whatever type, is the reason why it is closed.
                    with contextlib.suppress(Exception):
                        radio._radio.close()
                    radio._radio = None
            elif radio._radio is None:
                with radio._lock:
                    radio._rsp_queues.clear()


def release(driver: CRTPDriver) -> None:
    """End the thread of a radio link, even if a dead dongle blocks it; never blocks."""
    if not isinstance(driver, RadioDriver):
        return
    thread, radio = driver._thread, driver._radio
    if thread is not None:
        thread._sp = True
    if radio is not None:
        radio._rsp_queue.put(None)


class BroadcastingRadio(Crazyradio):
    """cflib's dongle, which can send without acknowledgement to `BROADCAST_ADDRESS`.

    Without acknowledgement the dongle gives no answer (its USB protocol), and cflib waits for one.
    """

    @override
    def set_address(self, address: Sequence[int]) -> None:
        is_broadcast = tuple(address) == BROADCAST_ADDRESS
        if is_broadcast != self._is_broadcasting:
            self.set_ack_enable(not is_broadcast)
        super().set_address(address)

    @override
    def send_packet(self, dataOut: Any) -> Any:
        """Send a packet, or to the broadcast address a sequence of them."""
        if not self._is_broadcasting:
            return super().send_packet(dataOut)
        for data in dataOut:
            # As cflib: the next unicast packet shows that the dongle is gone.
            with contextlib.suppress(OSError):
                self.handle.write(endpoint=1, data=data, timeout=1000)
            time.sleep(PACKET_GAP)
        return None

    @property
    def _is_broadcasting(self):
        return self.current_address is not None and (
            tuple(self.current_address) == BROADCAST_ADDRESS
        )


class RadioBroadcast:
    """A user of a dongle that broadcasts on the channel of a vehicle's address (a URI)."""

    def __init__(self, uri: str):
        self._uri = uri
        self._instance: radiodriver._SharedRadioInstance | None = None

    def transmit(self, packets: Sequence[bytes]) -> None:
        """Send packets, before all that waits for the dongle; blocks until they are sent.

        Raises `OSError` if the dongle is not there, or does not react.
        """
        try:
            if self._instance is None:
                forget_dead_radios()
                self._devid, self._channel, self._rate, *_ = RadioDriver.parse_uri(self._uri)
                self._instance = RadioManager.open(self._devid)
            instance, commands = self._instance, self._instance._cmd_queue
            where = (self._channel, BROADCAST_ADDRESS, self._rate)
            send = radiodriver._RadioCommands.SEND_PACKET
            command = (instance._instance_id, send, (*where, packets))
            with commands.mutex:
                commands.queue.appendleft(command)
                commands.not_empty.notify()
            instance._rsp_queue.get(timeout=_DONGLE_LIMIT)
        except queue.Empty:
            # A dongle that goes on later must not send it then.
            with commands.mutex, contextlib.suppress(ValueError):
                commands.queue.remove(command)
            self.close()
            raise OSError("the Crazyradio does not react") from None
        except Exception as error:
            # cflib raises bare exceptions.
            self.close()
            raise OSError(str(error)) from None

    def close(self) -> None:
        """Leave the dongle to its other users."""
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.close()


check_private_names()
# The threads that own the dongles make them by this name.
radiodriver.Crazyradio = BroadcastingRadio
