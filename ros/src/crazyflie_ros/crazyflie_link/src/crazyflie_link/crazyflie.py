"""A vehicle, over a link that is set up again after a loss."""

import threading
import time
from collections.abc import Callable

from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.address import Address
from crazyflie_link.broadcast import is_broadcast
from crazyflie_link.console import Console
from crazyflie_link.emergency import EmergencyStop
from crazyflie_link.errors import RefusedError, UnknownNameError, ValueRangeError
from crazyflie_link.high_level import HighLevel
from crazyflie_link.lighthouse import Lighthouse
from crazyflie_link.link import LOG_DATA, Link, OnPacket
from crazyflie_link.link_monitor import Uptime
from crazyflie_link.link_setup import Limits
from crazyflie_link.localization import Localization
from crazyflie_link.log import Log, LogBlock
from crazyflie_link.parameters import FirmwareParameters
from crazyflie_link.reboot import reboot
from crazyflie_link.reconnector import LinkState, Reconnector
from crazyflie_link.safe_crazyflie import table_cache
from crazyflie_link.setpoints import Setpoints
from crazyflie_link.supervisor import Supervisor
from crazyflie_link.trajectory import Trajectories

_STAMP_END = 4  #: A log packet begins with the number of its block and three bytes of time.


class Crazyflie:
    """A vehicle: connect, use, close; or use it in a ``with`` statement.

    The first `connect` succeeds or raises. After that the link is watched: when no packet has come
    for 0.45 s, or no log data, it is lost. If the vehicle is heard again soon, the link is taken up
    as it was; otherwise, with ``reconnect``, a new one is tried at once, then with growing pauses
    until `close`, and log blocks are started anew; those that the vehicle then refuses are named in
    the text of the state.

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
    limits : Limits, optional
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
        limits: Limits | None = None,
    ):
        self.address = Address.parse(uri)
        self._emergency = EmergencyStop(lambda: self._reconnector.any_link())
        self._reconnector = Reconnector(
            self.address.uri,
            lambda: self._make_link(cache, limits),
            self._start_blocks,
            lambda: self._emergency.is_requested,
            on_state,
            reconnect,
        )
        link = self.link
        #: setpoints, high_level, trajectories, localization, lighthouse, parameters, log,
        #: supervisor: Parts of the firmware; see their classes.
        self.setpoints = Setpoints(link)
        self.high_level = HighLevel(link)
        self.trajectories = Trajectories(link, self.high_level)
        self.localization = Localization(link)
        self.lighthouse = Lighthouse(link)
        self.parameters = FirmwareParameters(link)
        self._uptime = Uptime()
        self.log = Log(link, self._uptime)
        self.supervisor = Supervisor(link, self._emergency)
        self.restarts = self.sent = 0  #: Packets that were sent to this vehicle alone.
        self._on_packet = on_packet
        self._blocks: list[LogBlock] = []
        self._blocks_lock = threading.Lock()
        self._console = Console(on_console) if on_console is not None else None
        #: Strength of the vehicle's reception (-dBm), as the Crazyradio has it; None elsewhere.
        self.rssi: float | None = None

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
        return self._reconnector.state

    @property
    def connection_count(self) -> int:
        """How many times the link has been set up."""
        return self._reconnector.connection_count

    def connect(self) -> None:
        """Connect for the first time; blocks. A `CrazyflieError` has the reason and what to do."""
        self._reconnector.connect()

    def link(self) -> Link:
        """Return the link on which the vehicle is heard; `LinkLostError` if there is none."""
        return self._reconnector.link()

    def add_log_block(self, block: LogBlock) -> None:
        """Have the vehicle send a block, now and after every reconnection; blocks.

        Raises `CrazyflieError` if the block is not possible.
        """
        self.log.start(block)
        with self._blocks_lock:
            self._blocks.append(block)

    def send_packet(self, port: int, channel: int, data: bytes) -> None:
        """Send a CRTP packet with at most 30 bytes of data."""
        self.link().send(port, channel, data)

    def latency(self) -> float:
        """Return the time that 95 % of the latest pings took at most, s."""
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
        """Restart the vehicle, or switch it off; see `crazyflie_link.reboot`. Blocks.

        The link is lost by that: it is taken up again if `reconnect` is set.
        """
        reboot(self.address, lambda: self._reconnector.close_link("the vehicle is restarted"), mode)

    def close(self) -> None:
        """End the connection; safe to call twice and while connecting."""
        self._emergency.close()
        self._reconnector.close()

    def _make_link(self, cache, limits):
        folder = table_cache() if cache is None else cache
        link = Link(self.address, limits, folder, self._on_received)
        link.cflib.packet_sent.add_callback(self._on_sent)
        link.cflib.link_statistics.uplink_rssi_updated.add_callback(self._on_rssi)
        return link

    def _start_blocks(self):
        # Other firmware may have been installed; the vehicle needs a link all the same.
        refused = ""
        with self._blocks_lock:
            for block in self._blocks:
                try:
                    self.log.start(block)
                except (RefusedError, UnknownNameError, ValueRangeError) as error:
                    refused += f", without log block {block.name!r}: {error}"
        return refused

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

    def _on_sent(self, sent):
        self.sent += not is_broadcast(sent)

    def _on_rssi(self, rssi):
        self.rssi = rssi
