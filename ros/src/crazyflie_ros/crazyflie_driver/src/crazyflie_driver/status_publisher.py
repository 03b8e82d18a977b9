"""Topics with the state of a vehicle, and whether the driver is connected to it."""

import contextlib
import math
from dataclasses import dataclass

from std_msgs.msg import Bool, Header, String

from crazyflie_driver import status
from crazyflie_driver.battery import Battery
from crazyflie_driver.connection import Connection
from crazyflie_driver.log_topics import LogTopics
from crazyflie_driver.setpoint_topics import SetpointTopics
from crazyflie_driver.vehicle_parameters import (
    CONNECTED_TOPIC,
    STATUS_TOPIC,
    VEHICLE_STATUS_TOPIC,
)
from crazyflie_link.broadcast import Broadcaster
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_link.errors import LinkLostError
from crazyflie_msgs.msg import VehicleStatus
from crazyflie_utils import NodeHandle

PERIOD = 1.0  #: How often both are repeated, s: their absence shows that the driver is gone.

_LINKS = {name: value for value, name in status.LINK_NAMES.items()}


#: Fields that are published when they change.
_STATES = ("text", "link", "supervisor", "has_supervisor", "is_emergency", "battery", "is_streamed")
_MOST = 1 << 15  #: Packets in a second. The vehicle counts in 16 bits; more is its restart.


@dataclass(eq=False)
class StatusPublisher:
    """Publish the status of a vehicle, in words and typed, and whether it is connected."""

    _handle: NodeHandle
    _prefix: str
    _crazyflie: Crazyflie
    _log: LogTopics
    _setpoints: SetpointTopics
    _battery: Battery
    _connection: Connection
    broadcaster: Broadcaster | None = None  #: Counts what is sent to all vehicles of its channel.
    # Counts of received and sent broadcasts, received and sent unicasts; and in the last period.
    _counts: tuple[int, ...] = (0, 0, 0, 0)
    _in_period: tuple[int, ...] = (0, 0, 0, 0)
    _published: VehicleStatus | None = None
    _is_connected: bool = False

    def __post_init__(self) -> None:
        prefix = self._prefix
        self._text = self._handle.publisher(f"{prefix}/{STATUS_TOPIC}", String, latch=True)
        self._typed = self._handle.publisher(
            f"{prefix}/{VEHICLE_STATUS_TOPIC}", VehicleStatus, latch=True
        )
        self._connected = self._handle.publisher(f"{prefix}/{CONNECTED_TOPIC}", Bool, latch=True)
        self._connected.publish(Bool(False))
        self._handle.timer(PERIOD, self._repeat)

    def status(self) -> VehicleStatus:
        """Return what is known of the vehicle now."""
        crazyflie, battery = self._crazyflie, self._battery
        state = self._log.supervisor
        message = VehicleStatus(
            header=Header(stamp=self._handle.stamp()),
            link=_LINKS[crazyflie.state.value],
            link_text=self._connection.text,
            supervisor=int(state or 0),
            has_supervisor=state is not None,
            is_emergency=self._setpoints.gate.is_emergency,
            battery=int(battery.charge),
            battery_voltage=_or_nan(battery.voltage),
            link_quality=math.nan,
            latency=math.nan,
            last_heard=math.nan,
            rssi=_or_nan(self._log.rssi),
            is_streamed=self._setpoints.is_streaming,
            setpoint_rate=self._setpoints.rate(),
            setpoints_ignored=self._setpoints.ignored,
            are_setpoints_blocked=self._setpoints.gate.is_blocking(self._handle.time()),
            restarts=crazyflie.restarts,
            pm_state=_power_state(self._log.power_state),
            supervisor_info=int(state or 0),
        )
        (
            message.num_rx_broadcast,
            message.num_tx_broadcast,
            message.num_rx_unicast,
            message.num_tx_unicast,
        ) = self._in_period
        # Without a link there are no figures.
        with contextlib.suppress(LinkLostError):
            message.link_quality = crazyflie.quality()
            message.is_link_poor = crazyflie.is_poor()
            message.latency = crazyflie.latency()
            message.latency_unicast = _milliseconds(message.latency)
            message.last_heard = crazyflie.age()
        message.text = status.words(message)
        return message

    def publish(self) -> None:
        """Publish what is new."""
        message = self.status()
        before, self._published = self._published, message
        if any(getattr(message, name) != getattr(before, name, None) for name in _STATES):
            self._typed.publish(message)
        if before is None or message.text != before.text:
            self._text.publish(String(message.text))
        is_ready = self._connection.is_established and not self._connection.is_closing
        self.publish_connected(is_ready and message.link == VehicleStatus.CONNECTED)

    def publish_connected(self, is_connected: bool) -> None:
        """Publish whether the vehicle is connected, if that is new."""
        if is_connected != self._is_connected:
            self._is_connected = is_connected
            self._connected.publish(Bool(is_connected))

    def _count_packets(self):
        log, broadcaster = self._log, self.broadcaster
        sent = 0 if broadcaster is None else broadcaster.sent
        counts = (log.received_broadcasts, sent, log.received_unicasts, self._crazyflie.sent)
        new = [(now - before) & 0xFFFF for now, before in zip(counts, self._counts, strict=True)]
        self._counts = counts
        self._in_period = tuple(count if count < _MOST else 0 for count in new)

    def _repeat(self):
        self._count_packets()
        self._typed.publish(self.status())
        self._connected.publish(Bool(self._is_connected))


def _or_nan(value):
    return math.nan if value is None else value


def _power_state(state):
    return VehicleStatus.PM_STATE_UNKNOWN if state is None else state & 0xFF


def _milliseconds(latency):
    return min(round(1000.0 * latency), 0xFFFF) if math.isfinite(latency) else 0
