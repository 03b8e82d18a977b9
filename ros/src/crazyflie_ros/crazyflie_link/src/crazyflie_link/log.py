"""Log blocks: variables that the vehicle sends periodically."""

import contextlib
import errno
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

from cflib.crazyflie import log as cflib_log
from cflib.crazyflie.log import (
    CHAN_SETTINGS,
    CMD_APPEND_BLOCK_V2,
    CMD_CREATE_BLOCK_V2,
    CMD_DELETE_BLOCK,
    LogConfig,
)
from cflib.crtp.crtpstack import CRTPPort
from cflib.utils.encoding import decompress_quaternion

from crazyflie_link.errors import (
    CrazyflieError,
    NoReplyError,
    RefusedError,
    ValueRangeError,
    unknown_name,
)
from crazyflie_link.limits import LONGEST_PERIOD_MS, PERIOD_STEP_MS, SHORTEST_PERIOD_MS
from crazyflie_link.link import Link
from crazyflie_link.subsystem import Subsystem, elements
from crazyflie_link.transmission import RESEND_PERIOD, Request

_STAMP_END = 4  #: A log packet begins with the number of its block and three bytes of time.
_TICKS = 1 << 24  #: The vehicle's time in ms has 24 bits.
#: Largest age of a packet that was overtaken by another (ms). Largest delay of the fastest packet
#: (ms): this machine may have been busy.
_REORDERED_MS = 100
_LATEST_FIRST_MS = 60_000.0

#: Largest number of attempts to start a block of three packets: a lost answer needs another one.
_ATTEMPTS = 5

#: Command -> error of a repetition whose first answer was lost: the block exists, or is full.
_REPEATED = {CMD_CREATE_BLOCK_V2: errno.EEXIST, CMD_APPEND_BLOCK_V2: errno.E2BIG}


def quaternion_from_compressed(number: int) -> tuple[float, ...]:
    """Return the unit quaternion (x, y, z, w) of the log variable stateEstimateZ.quat.

    It has 32 bits: which component is largest, and the three others with 10 bits each.
    """
    return tuple(map(float, decompress_quaternion(int(number))))


@dataclass(frozen=True)
class LogBlock:
    """Variables that come together.

    The period is 10 to 2540 ms, in steps of 10. Variables, such as "stateEstimate.x", come in the
    vehicle's own types, together at most 26 bytes. ``callback(time_ms, values)`` is called in
    cflib's thread with the vehicle's time (ms since it was switched on; it comes with 24 bits;
    higher bits from before the connection are not known) and numbers in the order of the variables.
    """

    name: str
    period_ms: int
    variables: tuple[str, ...]
    callback: Callable[[int, tuple[float, ...]], None] = field(compare=False)


class Uptime:
    """The vehicle's clock, in log packets, which is 0 when the firmware starts.

    Its 24 bits also wrap to 0 every 4.66 h. The firmware has restarted if an unwrapped time would
    be ahead of this machine's clock: packets come late, but never early.
    """

    def __init__(self) -> None:
        # The second last one was received, and its time with all bits.
        self._latest: tuple[int, float] | None = None
        self._late_ms = 0.0

    def has_restarted(self, time_ms: int, now: float) -> bool:
        """Return whether the clock (ms, 24 bits), read at a time (s), shows a restart."""
        if self._latest is None:
            self._latest = time_ms, now
            return False
        before_ms, before = self._latest
        elapsed_ms = 1000.0 * (now - before)
        if (before_ms - time_ms) % _TICKS <= _REORDERED_MS and elapsed_ms < _TICKS / 2:
            return False
        step_ms = (time_ms - before_ms) % _TICKS
        # After hours without a packet.
        step_ms += _TICKS * max(0, round((elapsed_ms - step_ms) / _TICKS))
        # Delay of this packet relative to the fastest one.
        late = self._late_ms + elapsed_ms - step_ms
        self._late_ms = max(0.0, late)
        has_restarted = late < -_LATEST_FIRST_MS
        self._latest = (time_ms if has_restarted else before_ms + step_ms), now
        return has_restarted

    def unwrapped(self, time_ms: int) -> int:
        """Return a time (ms, 24 bits) near the latest one with all its bits.

        It never jumps back while the vehicle is on; bits that it had before the first call are
        not known.
        """
        if self._latest is None:
            return time_ms
        ahead = (time_ms - self._latest[0] + _TICKS // 2) % _TICKS - _TICKS // 2
        return max(0, self._latest[0] + ahead)


class Log(Subsystem):
    """The log variables and log blocks of a vehicle."""

    def __init__(self, current_link: Callable[[], Link]):
        super().__init__(current_link)
        self._uptime = Uptime()

    def shows_restart(self, data: bytes, now: float) -> bool:
        """Return whether a packet of log data, received at a time (s), shows a restart."""
        if len(data) <= _STAMP_END:
            return False
        return self._uptime.has_restarted(int.from_bytes(data[1:_STAMP_END], "little"), now)

    def variables(self) -> dict[str, str]:
        """Return the vehicle's variables: "group.name" -> C type, sorted by name."""
        table = self._current_link().cflib.log.toc.toc
        return {name: element.ctype for name, element in elements(table).items()}

    def check(self, block: LogBlock) -> None:
        """Check that the vehicle can send a block.

        Raises `UnknownNameError` for a variable, `ValueRangeError` for period, number or size.
        """
        is_in_range = SHORTEST_PERIOD_MS <= block.period_ms <= LONGEST_PERIOD_MS
        if not is_in_range or block.period_ms % PERIOD_STEP_MS:
            raise ValueRangeError(
                f"log block {block.name!r}: its period is {block.period_ms} ms; expected "
                f"{SHORTEST_PERIOD_MS} to {LONGEST_PERIOD_MS} ms, in steps of {PERIOD_STEP_MS} (a "
                "frequency is not meant)"
            )
        if not block.variables:
            raise ValueRangeError(f"log block {block.name!r} has no variables")
        known = elements(self._current_link().cflib.log.toc.toc)
        size = 0
        for variable in block.variables:
            if variable not in known:
                raise unknown_name("log variable", variable, list(known))
            size += struct.calcsize(known[variable].pytype)
        if size > LogConfig.MAX_LEN:
            raise ValueRangeError(
                f"log block {block.name!r}: its {len(block.variables)} variables take {size} "
                f"bytes; at most {LogConfig.MAX_LEN} fit in a packet: make it two blocks"
            )

    def start(self, block: LogBlock) -> None:
        """Start a block; blocks until the vehicle has confirmed it, or raises `CrazyflieError`."""
        self.check(block)
        link = self._current_link()
        what = f"log block {block.name!r}"
        config = LogConfig(block.name, block.period_ms)
        for variable in block.variables:
            config.add_variable(variable)

        def deliver(time_ms, values, _):
            block.callback(
                self._uptime.unwrapped(time_ms),
                tuple(values[variable] for variable in block.variables),
            )

        config.data_received_cb.add_callback(deliver)
        try:
            packets = _packets(link.cflib.log, config)
        except (AttributeError, KeyError) as error:
            raise RefusedError(f"{what}: {error}") from None
        try:
            for _ in range(_ATTEMPTS):
                if self._send(link, packets, what):
                    break
                self._delete(link, packets, what)
            else:
                raise NoReplyError(
                    f"{what}: a part of it was not confirmed in {_ATTEMPTS} attempts: the link is "
                    "poor; come nearer, or make it several blocks of 9 variables"
                )
        except RefusedError:
            # What was accepted would take room from other blocks.
            with contextlib.suppress(CrazyflieError):
                self._delete(link, packets, what)
            raise
        link.monitor.expect_log(block.period_ms / 1000.0, time.monotonic())

    def _send(self, link, packets, what):
        # Returns False if it is not known whether variables were appended: if they were, a
        # repetition would displace those of the next packet.
        for data in packets:
            if data[0] != CMD_APPEND_BLOCK_V2 or data is packets[-2]:
                code = link.request(data, _request(data, what))[2]
            else:
                try:
                    once = replace(_request(data, what), resend=False, limit=RESEND_PERIOD)
                    code = link.request(data, once)[2]
                except NoReplyError:
                    return False
            if code not in (0, _REPEATED.get(data[0])):
                reason = cflib_log.Log._err_codes.get(code, f"error {code}")
                raise RefusedError(f"{what}: the vehicle answers: {reason}")
        return True

    def _delete(self, link, packets, what):
        # Its answer also shows that no earlier one is under way.
        data = bytes([CMD_DELETE_BLOCK, packets[0][1]])
        link.request(data, _request(data, f"{what}, deleting it"))


def _request(data, what):
    begin, accepts = data[:2], lambda answer: len(answer) > 2
    return Request(CRTPPort.LOGGING, CHAN_SETTINGS, begin, what, accepts=accepts)


def _packets(log: cflib_log.Log, config: LogConfig) -> list[bytes]:
    """Add a block to those that cflib receives; return the packets that create and start it.

    cflib would send them all at once: one that overtakes a lost one is refused, and cflib does not
    notice that. Raises `AttributeError` or `KeyError` if the block exceeds cflib's limits.
    """
    packets: list[bytes] = []

    def send_packet(sent, expected_reply):
        packets.append(bytes(sent.data))

    log.add_config(config)
    config.cf = SimpleNamespace(log=log, link=True, send_packet=send_packet)
    config.start()
    # Otherwise cflib starts it as well.
    config.added = True
    config.start()
    return packets
