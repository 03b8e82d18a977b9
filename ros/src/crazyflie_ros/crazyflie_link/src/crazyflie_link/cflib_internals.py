"""cflib, safe to use from many threads and for many vehicles; its private names that this uses.

All vehicles of a dongle share one thread of cflib, which ends at an error of the USB device.
Every later send through it blocks for ever, and later connections are given the dead thread
again. An attempt to open a dongle that is absent leaves an entry that is never removed.
"""

import contextlib
import importlib
import logging
import os
import queue
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import cflib.crtp
from cflib.crazyflie import Crazyflie as CflibCrazyflie
from cflib.crazyflie.platformservice import LINKSERVICE_SOURCE
from cflib.crtp import radiodriver
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort
from cflib.crtp.radiodriver import RadioDriver, RadioManager
from cflib.drivers.crazyradio import Crazyradio
from cflib.utils.callbacks import Caller
from typing_extensions import override

TESTED_VERSION = "cflib==0.1.34"  #: That of ros/requirements.txt.

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
    # The name by which cflib creates its dongles.
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

#: Time between two broadcast packets (s): a vehicle passes one to its main processor at 1 Mbit/s,
#: with 37 bytes of 10 bits in 0.37 ms; crazyflie_cpp uses the same time.
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
                f"version it was tested with, {TESTED_VERSION}"
            )


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


def lacks_safelink(driver: CRTPDriver) -> bool:
    """Return whether a radio link has no numbered packets (safelink), once it is heard.

    Without them a packet whose acknowledgement is lost arrives twice, and a vehicle that still
    expects numbers drops packets. cflib asks for them in its first ten packets only.
    """
    return isinstance(driver, RadioDriver) and driver.needs_resending


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
        """Send packets, before all others that wait for the dongle; blocks until they are sent.

        Raises `OSError` if the dongle is missing, or does not react.
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
            # A dongle that continues later must not send it then.
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


_init_lock = threading.Lock()

_UDP_RECEIVE_LIMIT = 0.1

#: Time limit for a running callback, or for other dongles, when a link ends, s.
_JOIN_LIMIT = 0.3
CLOSE_LIMIT = 1.0  #: Time limit for the driver when a link ends, s.

_log = logging.getLogger(__name__)

# cflib also logs, with tracebacks, the errors that it reports; this package reports them itself.
if logging.getLogger("cflib").level == logging.NOTSET:
    logging.getLogger("cflib").setLevel(logging.CRITICAL)


def init_drivers() -> None:
    """Register cflib's drivers, once in a process."""
    with _init_lock:
        if not cflib.crtp.CLASSES:
            cflib.crtp.init_drivers()


def table_cache() -> str | None:
    """Return the user's folder for log and parameter tables; None when it cannot be written.

    It is ``$XDG_CACHE_HOME/crazyflie_link`` or ``~/.cache/crazyflie_link``. cflib names the
    files by the tables' checksums, so that other firmware has other files.
    """
    base = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(base) / "crazyflie_link"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return None
    return str(folder) if os.access(folder, os.W_OK) else None


def packet(port: int, channel: int, data: bytes) -> CRTPPacket:
    """Return a CRTP packet with at most 30 bytes of data."""
    result = CRTPPacket()
    result.set_header(port, channel)
    result.data = bytes(data)
    return result


class _Guarded(Caller):
    """cflib's list of callbacks for packets; no exception in one ends the receiving thread."""

    def call(self, *args):
        for callback in list(self.callbacks):
            try:
                callback(*args)
            except Exception:
                _log.warning("a packet could not be handled", exc_info=True)


class SafeCrazyflie(CflibCrazyflie):
    """cflib's Crazyflie for a single connection; a new one is made for the next.

    ``on_error(text)`` is called, in one of cflib's threads and maybe several times, when a driver
    gives up.
    """

    link: CRTPDriver | None
    packet_received: Caller

    def __init__(self, cache: str | None, on_error: Callable[[str], None]):
        super().__init__(rw_cache=cache)
        self._on_error = on_error
        self._setup_begun = False
        self._disconnecting = threading.Lock()
        # Unlike cflib's own, only its owner can release it; see `send_packet`.
        self._send_lock = threading.RLock()
        guarded = _Guarded()
        guarded.callbacks = self.packet_received.callbacks
        self.packet_received = guarded
        self.link_established.add_callback(self._tune_udp)

    def request_source(self) -> None:
        """Send the first request of the set-up again: cflib does not."""
        self.send_packet(packet(CRTPPort.LINKCTRL, LINKSERVICE_SOURCE, b"\0"))

    def send_packet(
        self,
        pk: CRTPPacket,
        expected_reply: tuple[int, ...] = (),
        resend: bool = False,
        timeout: float = 0.2,
    ) -> None:
        """Send a packet; never raises.

        An error in a driver, or a link that is closed meanwhile, would keep cflib's lock, and
        block every later call for ever.
        """
        try:
            super().send_packet(pk, expected_reply, resend, timeout)
        except Exception as error:
            # The lock is not held at every error.
            with contextlib.suppress(RuntimeError):
                self._send_lock.release()
            # Without a link, it was closed on purpose meanwhile.
            if self.link is not None:
                self._on_error(f"cannot send: {error}")

    def disconnect(self) -> None:
        """End the connection without another packet; blocks for 2 s at most.

        cflib's own ``close_link`` sends a setpoint of zero thrust first, which would
        take a vehicle out of the air that flies by itself.
        """
        with self._disconnecting:
            self.incoming.stop()
            link = self.link
            if link is not None:
                _wake_receiver(link)
            if self.incoming.is_alive() and not self.is_called_by_incoming_handler_thread():
                self.incoming.join(timeout=_JOIN_LIMIT)
            self.link = None
            # A driver joins its threads, and cflib its own, without a limit; and cflib's lock of
            # the dongles is held for as long as one of them hangs.
            _run(lambda: self._close(link), CLOSE_LIMIT)
            _run(forget_dead_radios, _JOIN_LIMIT)

    def _close(self, link):
        if link is not None:
            release(link)
            link.close()
        self.disconnected.call(self.link_uri)

    def _link_error_cb(self, errmsg):
        # cflib's own version closes the link and joins its threads right here:
        # in whichever thread met the error, the one that holds the send lock
        # included, and then they wait for each other for ever.
        self._on_error(errmsg)

    def _platform_info_fetched(self):
        # Where the first request is sent twice, its answer may come twice.
        if not self._setup_begun:
            self._setup_begun = True
            super()._platform_info_fetched()

    def _tune_udp(self, _):
        link = self.link
        if link is not None and link.get_name() == "udp":
            # cflib resends nothing over UDP: one lost packet would end the set-up.
            link.needs_resending = True
            # Its receiver looks up once in this time, and `disconnect` waits for it.
            link.socket.settimeout(_UDP_RECEIVE_LIMIT)


def _run(work, limit):
    # The wait is limited.
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(limit)


def _wake_receiver(link):
    # The thread that hands packets out looks up only once a second.
    # A driver without a queue has no such thread.
    with contextlib.suppress(AttributeError):
        link.in_queue.put(None)


check_private_names()
# The threads that own the dongles make them by this name.
radiodriver.Crazyradio = BroadcastingRadio
