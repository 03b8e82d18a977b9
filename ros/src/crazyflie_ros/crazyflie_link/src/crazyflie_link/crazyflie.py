"""A vehicle, whose link may come and go."""

import enum
import threading
import time
from collections.abc import Callable

from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.address import Address
from crazyflie_link.backend import CLOSE_LIMIT, table_cache
from crazyflie_link.console import Console
from crazyflie_link.emergency import EmergencyStop
from crazyflie_link.errors import (
    CrazyflieError,
    LinkLostError,
    RefusedError,
    UnknownNameError,
    ValueRangeError,
)
from crazyflie_link.high_level import HighLevel
from crazyflie_link.link import LOG_DATA, Limits, Link, OnPacket
from crazyflie_link.liveness import Life, Uptime
from crazyflie_link.localization import Localization
from crazyflie_link.log import Log, LogBlock
from crazyflie_link.parameters import FirmwareParameters
from crazyflie_link.reboot import reboot
from crazyflie_link.setpoints import Setpoints
from crazyflie_link.supervisor import Supervisor
from crazyflie_link.trajectory import Trajectories

CHECK_PERIOD = 0.05
"""How often the link is looked at, s."""

_JOIN_LIMIT = 0.3

_STAMP_END = 4
"""A log packet begins with the number of its block and three bytes of time."""

PATIENCE = 1.0
"""How long, in s, a link on which nothing comes any more is kept: one on which the vehicle is
heard again needs no set-up. Silence of up to 1.4 s ends that way before 2 s, when the firmware
locks; setting up a new link can take a second on a busy machine."""

FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
"""Pause after the first failed attempt to connect again, and the longest one, s; each is
twice the one before."""


class LinkState(enum.Enum):
    """State of the link to a vehicle."""

    DISCONNECTED = "disconnected"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    LOST = "lost"


class Crazyflie:
    """A vehicle: connect, use, close; or use it in a ``with`` statement.

    The first `connect` succeeds or raises. After that the link is watched: when
    no sign of life has come for 0.45 s, or no log data, it is lost. If the vehicle is
    heard again soon, the link is taken up as it was; otherwise, with ``reconnect``, a new one
    is tried at once and then with growing pauses until `close`, and log blocks are started anew;
    those that the vehicle then refuses are named in the text of the state.

    All callbacks come from threads of this object or of cflib, and must be quick.

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
    limits : Limits, optional
        Time limits.

    Attributes
    ----------
    setpoints, high_level, trajectories, localization, parameters, log, supervisor
        What can be done with the vehicle; see their classes.
    links : int
        How many times the link has been set up.
    restarts : int
        How many times the vehicle's clock was seen to begin anew.

    Raises
    ------
    AddressError
        The address is malformed.
    """

    def __init__(
        self,
        uri: str,
        reconnect: bool = False,
        on_state: Callable[[LinkState, str], None] | None = None,
        on_console: Callable[[str], None] | None = None,
        on_packet: OnPacket | None = None,
        cache: str | None = None,
        limits: Limits | None = None,
    ):
        self.address = Address.parse(uri)
        self.setpoints = Setpoints(self.link)
        self.high_level = HighLevel(self.link)
        self.trajectories = Trajectories(self.link, self.high_level)
        self.localization = Localization(self.link)
        self.parameters = FirmwareParameters(self.link)
        self.log = Log(self.link)
        self._emergency = EmergencyStop(lambda: self._link or self._opening)
        self.supervisor = Supervisor(self.link, self._emergency)
        self.links = 0
        self.restarts = 0
        self._uptime = Uptime()
        self._silent_since: float | None = None
        self._closing: threading.Thread | None = None
        self._reconnect = reconnect
        self._on_state = on_state
        self._on_packet = on_packet
        self._cache = cache
        self._limits = limits
        self._link: Link | None = None
        self._state = LinkState.DISCONNECTED
        self._reason = "not connected yet"
        self._blocks: list[LogBlock] = []
        self._blocks_lock = threading.Lock()
        self._closed = threading.Event()
        self._watcher: threading.Thread | None = None
        self._console = Console(on_console) if on_console is not None else None
        self._rssi: float | None = None
        self._announced: tuple[LinkState, str] | None = None
        self._opening: Link | None = None

    def __enter__(self) -> "Crazyflie":
        """Connect."""
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    @property
    def state(self) -> LinkState:
        """State of the link."""
        return self._state

    def connect(self) -> None:
        """Connect for the first time; blocks.

        Raises
        ------
        CrazyflieError
            With the reason and what to do.
        """
        if self._watcher is not None or self._closed.is_set():
            raise CrazyflieError(f"{self.address.uri}: connect can be called once only")
        self._set_state(LinkState.CONNECTING, f"connecting to {self.address.uri}")
        try:
            self._open_link()
        except CrazyflieError as error:
            self._set_state(LinkState.DISCONNECTED, str(error))
            raise
        self._set_state(LinkState.CONNECTED, f"connected to {self.address.uri}")
        self._watcher = threading.Thread(target=self._watch, name="crazyflie-watch", daemon=True)
        self._watcher.start()

    def link(self) -> Link:
        """Return the living link.

        Raises
        ------
        LinkLostError
            There is none.
        """
        link = self._link
        if link is None or self._silent_since is not None:
            raise LinkLostError(f"no link to the vehicle: {self._reason}")
        return link

    def add_log_block(self, block: LogBlock) -> None:
        """Have the vehicle send a block, now and after every reconnection; blocks.

        Raises
        ------
        CrazyflieError
            The block is not possible.
        """
        self.log.start(block)
        with self._blocks_lock:
            self._blocks.append(block)

    def send_packet(self, port: int, channel: int, data: bytes) -> None:
        """Send a CRTP packet of one's own, with at most 30 bytes of data."""
        self.link().send(port, channel, data)

    def latency(self) -> float:
        """Return the time that 95 % of the latest pings took at most, s."""
        return float(self.link().cflib.link_statistics.latency.latency) / 1000.0

    def quality(self) -> float:
        """Return the share of the latest pings that were answered, 0 to 1."""
        return self.link().liveness.quality()

    def is_poor(self) -> bool:
        """Return whether hardly any of the latest pings were answered."""
        return self.link().liveness.is_poor()

    @property
    def rssi(self) -> float | None:
        """Strength of the vehicle's reception (-dBm), as the Crazyradio has it; None elsewhere."""
        return self._rssi

    def age(self) -> float:
        """Return the age of the last sign of life, s."""
        return self.link().liveness.age(time.monotonic())

    def reboot(self, mode: str = "firmware") -> None:
        """Restart the vehicle, or switch it off; only by radio. Blocks.

        The link is lost by that: it is taken up again if `reconnect` is set.

        Parameters
        ----------
        mode : str
            One of `crazyflie_link.reboot.MODES`.

        Raises
        ------
        CrazyflieError
            Not a radio link, or the vehicle has not acknowledged it.
        """
        reboot(self.address, lambda: self._drop("the vehicle is restarted"), mode)

    def close(self) -> None:
        """End the connection; safe to call twice and while connecting."""
        self._closed.set()
        self._emergency.close()
        opening = self._opening
        if opening is not None:
            opening.close()
        self._drop("the link was closed")
        watcher = self._watcher
        if watcher is not None and watcher is not threading.current_thread():
            watcher.join(timeout=_JOIN_LIMIT)
        if self._closing is not None:
            self._closing.join(timeout=CLOSE_LIMIT)
        self._set_state(LinkState.DISCONNECTED, "the link was closed")

    # The link and its end.

    def _open_link(self):
        cache = table_cache() if self._cache is None else self._cache
        link = Link(self.address, self._limits, cache, self._on_received)
        link.cflib.link_statistics.uplink_rssi_updated.add_callback(self._on_rssi)
        self._opening = link
        try:
            # `close` looks for it here; if it was called before, it has found nothing.
            self._end_if_closed(link)
            link.open()
        finally:
            self._opening = None
        self._link = link
        self.links += 1
        self._end_if_closed(link)

    def _end_if_closed(self, link):
        if self._closed.is_set():
            self._link = None
            link.close("the link was closed")
            raise LinkLostError("the link was closed while connecting")

    def _drop(self, reason):
        link, self._link = self._link, None
        self._reason = reason
        if link is not None:
            link.close(reason)

    def _watch(self):
        while not self._closed.wait(CHECK_PERIOD):
            link = self._link
            end = LinkLostError(self._reason) if link is None else link.error
            why = str(end)
            if link is not None and end is None:
                life, why = link.life()
                if self._is_usable(life, why):
                    continue
            # First announce it: to close the link takes a moment.
            self._link = None
            self._silent_since = None
            if self._closed.is_set():
                # `close` may have looked for it just now, and found nothing.
                if link is not None:
                    link.close("the link was closed")
                return
            self._set_state(LinkState.LOST, why)
            if link is not None:
                self._closing = threading.Thread(target=link.close, args=(why,), daemon=True)
                self._closing.start()
            if not self._reconnect or not self._try_again():
                return

    def _is_usable(self, life, text):
        # Whether the link may stay, for a while at least.
        now = time.monotonic()
        if life is Life.ALIVE:
            since, self._silent_since = self._silent_since, None
            if since is not None:
                self._set_state(LinkState.CONNECTED, f"{self.address.uri} is heard again")
            return True
        if life is Life.RESTARTED:
            return False
        if self._silent_since is None:
            self._silent_since = now
            self._set_state(LinkState.LOST, text)
        return now - self._silent_since < PATIENCE

    def _try_again(self):
        pause = 0.0
        while not self._has_closed_within(pause):
            pause = min(max(2.0 * pause, FIRST_PAUSE), LONGEST_PAUSE)
            try:
                self._open_link()
                refused = self._start_blocks()
            except CrazyflieError as error:
                self._drop(str(error))
                if not self._closed.is_set():
                    self._set_state(LinkState.LOST, str(error))
            else:
                text = f"connected to {self.address.uri} again{refused}"
                self._set_state(LinkState.CONNECTED, text)
                return True
        return False

    def _start_blocks(self):
        # Other firmware may have been installed; its pilot needs a link all the same.
        refused = ""
        with self._blocks_lock:
            for block in self._blocks:
                try:
                    self.log.start(block)
                except (RefusedError, UnknownNameError, ValueRangeError) as error:
                    refused += f", without log block {block.name!r}: {error}"
        return refused

    def _has_closed_within(self, pause):
        # An emergency stop does not wait for the next attempt.
        end = time.monotonic() + pause
        while time.monotonic() < end:
            if self._closed.wait(CHECK_PERIOD):
                return True
            if self._emergency.is_requested:
                break
        return self._closed.is_set()

    def _set_state(self, state, text):
        self._state = state
        self._reason = text
        if (state, text) == self._announced:
            return
        self._announced = (state, text)
        if self._on_state is not None:
            self._on_state(state, text)

    # What arrives, in cflib's thread.

    def _on_received(self, port, channel, data):
        self._emergency.receive(port, channel, data)
        if (port, channel) == LOG_DATA and len(data) > _STAMP_END:
            time_ms = int.from_bytes(data[1:_STAMP_END], "little")
            if self._uptime.has_restarted(time_ms, time.monotonic()):
                self.restarts += 1
                self.high_level.forget_trajectories()
        if port == CRTPPort.CONSOLE and channel == 0 and self._console is not None:
            self._console.receive(data)
        if self._on_packet is not None:
            self._on_packet(port, channel, data)

    def _on_rssi(self, rssi):
        self._rssi = rssi
