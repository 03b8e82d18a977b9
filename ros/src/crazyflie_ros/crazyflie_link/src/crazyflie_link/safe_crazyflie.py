"""cflib's Crazyflie, safe to use from many threads and for many vehicles in one process."""

import contextlib
import logging
import os
import threading
from collections.abc import Callable
from pathlib import Path

import cflib.crtp
from cflib.crazyflie import Crazyflie as CflibCrazyflie
from cflib.crazyflie.platformservice import LINKSERVICE_SOURCE
from cflib.crtp.crtpdriver import CRTPDriver
from cflib.crtp.crtpstack import CRTPPacket, CRTPPort
from cflib.utils.callbacks import Caller

from crazyflie_link.cflib_internals import forget_dead_radios, release

_init_lock = threading.Lock()

_UDP_RECEIVE_LIMIT = 0.1

#: Time limit for a running callback, or for other dongles, when a link ends, s.
_JOIN_LIMIT = 0.3
CLOSE_LIMIT = 1.0  #: Time limit for the driver when a link ends, s.

_log = logging.getLogger(__name__)

# cflib logs what it also reports, with tracebacks; we report it in other words.
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
                _log.warning("a packet could not be understood", exc_info=True)


class _LogErrors(dict[int, str]):
    """cflib's texts of the errors of log blocks, and one for those that it does not know.

    Without a text its thread that receives drops the refusal.
    """

    def __missing__(self, code: int) -> str:
        return f"error {code}"


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
        self.log._err_codes = _LogErrors(self.log._err_codes)
        self.link_established.add_callback(self._tune_udp)

    def request_source(self) -> None:
        """Send the first request of the set-up again: cflib does not."""
        self.send_packet(packet(CRTPPort.LINKCTRL, LINKSERVICE_SOURCE, b"\0"))

    def log_error(self, code: int) -> str:
        """Return the text of an error of a log block."""
        return self.log._err_codes[code]

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
            # Not every error comes while it is taken.
            with contextlib.suppress(RuntimeError):
                self._send_lock.release()
            # Without a link it was closed on purpose meanwhile.
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
    # Waits for it for a while only.
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(limit)


def _wake_receiver(link):
    # The thread that hands packets out looks up only once a second.
    # A driver without a queue has no such thread.
    with contextlib.suppress(AttributeError):
        link.in_queue.put(None)
