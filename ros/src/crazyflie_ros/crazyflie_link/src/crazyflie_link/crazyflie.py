"""Search for vehicles; a vehicle, over a link that is set up again after a loss."""

import codecs
import contextlib
import enum
import io
import threading
import time
from collections.abc import Callable

import cflib.crtp
from cflib.crtp.crtpstack import CRTPPort
from cflib.utils.power_switch import PowerSwitch

from crazyflie_link.address import DEFAULT_ADDRESS, Address, radio_address
from crazyflie_link.broadcast import is_broadcast
from crazyflie_link.cflib_internals import CLOSE_LIMIT, init_drivers, table_cache
from crazyflie_link.errors import (
    CrazyflieError,
    LinkLostError,
    NoAnswerError,
    NoSafelinkError,
    RefusedError,
    UnknownNameError,
    ValueRangeError,
    explain,
)
from crazyflie_link.firmware_parameters import FirmwareParameters
from crazyflie_link.high_level import HighLevel, Trajectories
from crazyflie_link.link import LOG_DATA, Link, LinkHealth, LinkTimeouts, OnPacket
from crazyflie_link.localization import Lighthouse, Localization
from crazyflie_link.log import Log, LogBlock
from crazyflie_link.setpoints import Setpoints
from crazyflie_link.supervisor import EmergencyStop, Supervisor

#: Mode -> cflib's name of it: restart into the firmware or the boot loader, switch the main
#: processor and the decks off or on again, switch everything off.
MODES = {
    "firmware": "reboot_to_fw",
    "bootloader": "reboot_to_bootloader",
    "sysoff": "stm_power_down",
    "syson": "stm_power_up",
    "alloff": "platform_power_down",
}

CHECK_PERIOD = 0.05  #: Period at which the link is checked, s.

#: Time for which a silent link is kept, s: if the vehicle is heard again, no set-up is needed.
#: Silence of up to 1.4 s ends that way before 2 s, when the firmware locks; the set-up of a new
#: link can take a second on a busy machine.
SILENCE_LIMIT = 1.0

_RETRY_PERIOD = 0.2  #: Time between two attempts to connect for the first time (s).

#: Pause after the first failed attempt to connect again, and the longest one, s; each is twice the
#: one before.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0

_JOIN_LIMIT = 0.3  #: Time limit of the thread that checks the link in `Crazyflie.close`, s.
_CLOSED = "the link was closed"


def scan(address: str = DEFAULT_ADDRESS) -> tuple[list[str], list[CrazyflieError]]:
    """Search for vehicles on all interfaces; takes some seconds with a radio.

    On UDP the ports 19850 to 19859 of 127.0.0.1, or of the environment variable SCAN_ADDRESS, are
    tried; by radio an address of up to 10 hexadecimal digits, or else `AddressError` is raised.

    Returns the addresses that were found, and an error for each interface that could not be
    searched, such as a missing Crazyradio.
    """
    number = radio_address(address)
    init_drivers()
    found: list[str] = []
    problems: list[CrazyflieError] = []
    for driver_class in cflib.crtp.CLASSES:
        # The radio driver prints its errors, and finds nothing.
        printed = io.StringIO()
        try:
            with contextlib.redirect_stdout(printed):
                found += [uri for uri, *_ in driver_class().scan_interface(number)]
        except Exception as error:
            printed.write(str(error) or repr(error))
        if printed.getvalue().strip():
            problems.append(explain(driver_class.__name__, printed.getvalue()))
    return found, problems


class LinkState(enum.Enum):
    """State of the link to a vehicle."""

    DISCONNECTED = "disconnected"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    LOST = "lost"


class Console:
    """The text that the firmware prints: ``on_line(text)`` is called for each line."""

    def __init__(self, on_line: Callable[[str], None]):
        self._on_line = on_line
        self._decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        self._line = ""

    def receive(self, data: bytes) -> None:
        """Take up to 30 bytes; a character may begin in one packet and end in the next."""
        *lines, self._line = (self._line + self._decoder.decode(data)).split("\n")
        for line in lines:
            self._on_line(line.rstrip("\r\0"))


class Crazyflie:
    """A vehicle: connect, use, close; or use it in a ``with`` statement.

    The first `connect` succeeds or raises. Afterwards a thread checks the link: when no packet has
    come for 0.45 s, or no log data, it is lost. If the vehicle is heard again within
    `SILENCE_LIMIT`, the link is used as it was. Otherwise, with ``reconnect``, a new one is tried
    at once, then with growing pauses until `close`, and log blocks are started again; blocks that
    the vehicle then refuses are named in the text of the state.

    All callbacks come from threads of this object or of cflib, and must be quick. Raises
    `AddressError` if the address is malformed.

    Parameters
    ----------
    uri : str
        Such as "radio://0/25/2M/E7E7E7E701" or "udp://127.0.0.1:19850".
    reconnect : bool
        Whether to connect again after the link was lost.
    on_state : callable, optional
        ``on_state(state, text)`` with a `LinkState` whenever it changes, and when an
        attempt to reconnect fails for another reason than the last; the text says why.
    on_console : callable, optional
        ``on_console(line)`` for every line that the firmware prints.
    on_packet : callable, optional
        ``on_packet(port, channel, data)`` for every packet that arrives.
    cache : str, optional
        Folder for log and parameter tables; by default in the user's cache.
    limits : LinkTimeouts, optional
        Time limits.
    """

    def __init__(
        self,
        uri: str,
        reconnect: bool = False,
        on_state: Callable[[LinkState, str], None] | None = None,
        on_console: Callable[[str], None] | None = None,
        on_packet: OnPacket | None = None,
        cache: str | None = None,
        limits: LinkTimeouts | None = None,
    ):
        self.address = Address.parse(uri)
        self.state = LinkState.DISCONNECTED  #: State of the link.
        self.connection_count = 0  #: Number of times that the link has been set up.
        #: Restarts of the firmware that were noticed, and packets sent to this vehicle alone.
        self.restarts = self.sent = 0
        #: Strength of the vehicle's reception (-dBm), as the Crazyradio has it; None elsewhere.
        self.rssi: float | None = None
        self._reconnect, self._cache, self._limits = reconnect, cache, limits
        self._on_state, self._on_packet = on_state, on_packet
        self._console = Console(on_console) if on_console is not None else None
        # The link may be silent or still being opened.
        self._emergency = EmergencyStop(lambda: self._opening or self._link)
        link = self.link
        #: setpoints, high_level, trajectories, localization, lighthouse, parameters, log,
        #: supervisor: Parts of the firmware; see their classes.
        self.setpoints = Setpoints(link)
        self.high_level = HighLevel(link)
        self.trajectories = Trajectories(link, self.high_level)
        self.localization = Localization(link)
        self.lighthouse = Lighthouse(link)
        self.parameters = FirmwareParameters(link)
        self.log = Log(link)
        self.supervisor = Supervisor(link, self._emergency)
        self._blocks: list[LogBlock] = []
        self._blocks_lock = threading.Lock()
        # The latest link that was opened, and the one that is being opened.
        self._link: Link | None = None
        self._opening: Link | None = None
        self._silent_since: float | None = None
        self._text = "not connected yet"
        self._closed = threading.Event()
        self._closing: threading.Thread | None = None
        self._watcher: threading.Thread | None = None

    def __enter__(self) -> "Crazyflie":
        """Connect."""
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def connect(self, limit: float = 0.0) -> None:
        """Connect for the first time; blocks. A `CrazyflieError` has the reason and what to do.

        Without an answer, it retries until a limit (s) or `close`; errors that waiting cannot
        correct are raised at once.
        """
        uri = self.address.uri
        if self._watcher is not None or self._closed.is_set():
            raise CrazyflieError(f"{uri}: connect can be called once only")
        end = time.monotonic() + limit
        while True:
            self._set_state(LinkState.CONNECTING, f"connecting to {uri}")
            try:
                self._open()
                break
            except CrazyflieError as error:
                self._set_state(LinkState.DISCONNECTED, str(error))
                may_come = isinstance(error, NoAnswerError) and time.monotonic() < end
                if not may_come or self._closed.wait(_RETRY_PERIOD):
                    raise
        self._set_state(LinkState.CONNECTED, f"connected to {uri}")
        self._watcher = threading.Thread(target=self._watch, name="crazyflie-watch", daemon=True)
        self._watcher.start()

    def link(self) -> Link:
        """Return the link on which the vehicle is heard; `LinkLostError` without a link."""
        link, reason = self._link, self._text
        if link is not None:
            if link.error is None and self._silent_since is None:
                return link
            if self.state is LinkState.CONNECTED:
                # The thread that checks the link has not noticed its end yet.
                reason = str(link.error or reason)
        raise LinkLostError(f"no link to the vehicle: {reason}")

    def add_log_block(self, block: LogBlock) -> None:
        """Start a log block, now and after every reconnection; blocks.

        Raises `CrazyflieError` if the vehicle cannot send the block.
        """
        self.log.start(block)
        with self._blocks_lock:
            self._blocks.append(block)

    def send_packet(self, port: int, channel: int, data: bytes) -> None:
        """Send a CRTP packet with at most 30 bytes of data."""
        self.link().send(port, channel, data)

    def protocol(self) -> int:
        """Return the version of the protocol that the vehicle speaks."""
        return self.link().protocol

    def latency(self) -> float:
        """Return the 95th percentile of the round-trip times of the latest pings, s."""
        return float(self.link().cflib.link_statistics.latency.latency) / 1000.0

    def quality(self) -> float:
        """Return the share of the latest pings that were answered, 0 to 1."""
        return self.link().monitor.quality()

    def is_poor(self) -> bool:
        """Return whether hardly any of the latest pings were answered."""
        return self.link().monitor.is_poor()

    def age(self) -> float:
        """Return the age of the vehicle's last packet, s."""
        return self.link().monitor.age(time.monotonic())

    def reboot(self, mode: str = "firmware") -> None:
        """Restart the vehicle or switch it off, as one of `MODES`; only by radio; blocks.

        The link is lost by that; with ``reconnect`` a new one is set up. Raises `CrazyflieError` if
        it is not a radio link, or the vehicle has not acknowledged the command.
        """
        uri = self.address.uri
        if not self.address.is_radio:
            raise RefusedError(
                f"{uri}: only a radio link can restart a vehicle; switch it off and on instead"
            )
        self._close_links("the vehicle is restarted")
        init_drivers()
        try:
            with contextlib.closing(PowerSwitch(uri)) as switch:
                getattr(switch, MODES[mode])()
        except Exception as error:
            # cflib raises bare exceptions.
            raise explain(uri, str(error)) from None

    def close(self) -> None:
        """End the connection; safe to call twice and while connecting."""
        self._emergency.close()
        self._closed.set()
        self._close_links(_CLOSED)
        watcher = self._watcher
        if watcher is not None and watcher is not threading.current_thread():
            watcher.join(timeout=_JOIN_LIMIT)
        if self._closing is not None:
            self._closing.join(timeout=CLOSE_LIMIT)
        self._set_state(LinkState.DISCONNECTED, _CLOSED)

    # The life of the link: opened by `connect`, then followed in a thread of its own.

    def _set_state(self, state, text):
        is_new = (state, text) != (self.state, self._text)
        self.state, self._text = state, text
        if is_new and self._on_state is not None:
            self._on_state(state, text)

    def _close_links(self, reason):
        for link in (self._opening, self._link):
            if link is not None:
                link.close(reason)

    def _open(self):
        try:
            self._open_link(needs_safelink=True)
        except NoSafelinkError:
            # It hears now. Other firmware may not have it.
            self._open_link(needs_safelink=False)

    def _open_link(self, needs_safelink):
        folder = table_cache() if self._cache is None else self._cache
        self._opening = link = Link(
            self.address,
            self._limits,
            folder,
            self._on_received,
            needs_safelink=needs_safelink,
        )
        link.cflib.packet_sent.add_callback(self._on_sent)
        link.cflib.link_statistics.uplink_rssi_updated.add_callback(self._on_rssi)
        try:
            # `close` closes the link that it finds here; if it was called before, it found none.
            self._end_if_closed(link)
            link.open()
            self._link, self._silent_since = link, None
        finally:
            self._opening = None
        self.connection_count += 1
        self._end_if_closed(link)

    def _end_if_closed(self, link):
        if self._closed.is_set():
            link.close(_CLOSED)
            raise LinkLostError("the link was closed while connecting")

    def _watch(self):
        while not self._closed.wait(CHECK_PERIOD):
            link = self._link
            assert link is not None, "connect has opened one"
            health, why = link.health()
            if self._is_usable(health, why):
                continue
            if self._closed.is_set():
                return
            # The loss is reported first: closing the link takes a moment.
            self._silent_since = time.monotonic()
            self._set_state(LinkState.LOST, why)
            self._closing = threading.Thread(target=link.close, args=(why,), daemon=True)
            self._closing.start()
            if not self._reconnect or not self._connect_again():
                return

    def _is_usable(self, health, text):
        # Decides whether the link may stay, at least for a while.
        if health is LinkHealth.ALIVE:
            was_silent = self._silent_since is not None
            self._silent_since = None
            if was_silent:
                self._set_state(LinkState.CONNECTED, f"{self.address.uri} is heard again")
            return True
        if health is not LinkHealth.SILENT:
            return False
        now = time.monotonic()
        if self._silent_since is None:
            self._silent_since = now
            self._set_state(LinkState.LOST, text)
        return now - self._silent_since < SILENCE_LIMIT

    def _connect_again(self):
        pause = 0.0
        while not self._has_closed_within(pause):
            pause = min(max(2.0 * pause, FIRST_PAUSE), LONGEST_PAUSE)
            try:
                self._open()
                problems = self._start_blocks()
            except CrazyflieError as error:
                self._close_links(str(error))
                if not self._closed.is_set():
                    self._set_state(LinkState.LOST, str(error))
            else:
                text = f"connected to {self.address.uri} again{problems}"
                self._set_state(LinkState.CONNECTED, text)
                return True
        return False

    def _has_closed_within(self, pause):
        end = time.monotonic() + pause
        while time.monotonic() < end and not self._closed.wait(CHECK_PERIOD):
            # An emergency stop does not wait for the next attempt.
            if self._emergency.is_requested:
                break
        return self._closed.is_set()

    def _start_blocks(self):
        # Returns the refused blocks: other firmware may have been installed, and the vehicle still
        # needs a link.
        refused = ""
        with self._blocks_lock:
            for block in self._blocks:
                try:
                    self.log.start(block)
                except (RefusedError, UnknownNameError, ValueRangeError) as error:
                    refused += f", without log block {block.name!r}: {error}"
        return refused

    # Packets, in cflib's thread.

    def _on_received(self, port, channel, data):
        self._emergency.receive(port, channel, data)
        if (port, channel) == LOG_DATA and self.log.shows_restart(data, time.monotonic()):
            self.restarts += 1
            self.high_level.forget_trajectories()
        if port == CRTPPort.CONSOLE and channel == 0 and self._console is not None:
            self._console.receive(data)
        if self._on_packet is not None:
            self._on_packet(port, channel, data)

    def _on_sent(self, sent):
        self.sent += not is_broadcast(sent)

    def _on_rssi(self, rssi):
        self.rssi = rssi
