"""Log blocks: variables that the vehicle sends periodically."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from cflib.crazyflie.log import LogConfig, LogTocElement
from cflib.utils.encoding import decompress_quaternion

from crazyflie_link.errors import (
    NoReplyError,
    RefusedError,
    ValueRangeError,
    unknown_name,
)
from crazyflie_link.link import Link
from crazyflie_link.link_monitor import Uptime
from crazyflie_link.request_reply import REPLY_LIMIT
from crazyflie_link.subsystem import Subsystem, elements

#: The firmware counts periods in 10 ms, in one byte of which 255 is not allowed.
SHORTEST_PERIOD_MS, LONGEST_PERIOD_MS, PERIOD_STEP_MS = 10, 2540, 10


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
    cflib's thread with the vehicle's time (ms since it was switched on; it comes with 24 bits, and
    what it had above these when it was connected is not known) and numbers in the order of the
    variables.
    """

    name: str
    period_ms: int
    variables: tuple[str, ...]
    callback: Callable[[int, tuple[float, ...]], None] = field(compare=False)


class Log(Subsystem):
    """The log variables of a vehicle, whose clock is followed by an uptime."""

    def __init__(self, current_link: Callable[[], Link], uptime: Uptime):
        super().__init__(current_link)
        self._uptime = uptime

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
        known = self.variables()
        size = 0
        for variable in block.variables:
            if variable not in known:
                raise unknown_name("log variable", variable, list(known))
            size += LogTocElement.get_size_from_id(
                LogTocElement.get_id_from_cstring(known[variable])
            )
        if size > LogConfig.MAX_LEN:
            raise ValueRangeError(
                f"log block {block.name!r}: its {len(block.variables)} variables take {size} "
                f"bytes; at most {LogConfig.MAX_LEN} fit in a packet: make it two blocks"
            )

    def start(self, block: LogBlock) -> None:
        """Have the vehicle send a block; blocks until it has agreed, or raises `CrazyflieError`."""
        self.check(block)
        link = self._current_link()
        backend = link.cflib
        config = LogConfig(block.name, block.period_ms)
        for variable in block.variables:
            config.add_variable(variable)
        decided = threading.Event()
        refusals: list[str] = []

        def refuse(_, text):
            refusals.append(text)
            decided.set()

        def note_start(_, is_started):
            # cflib reports a start that is refused here, too, and not as an error.
            if not is_started:
                refusals.append(backend.log_error(config.err_no))
            decided.set()

        def deliver(time_ms, values, _):
            block.callback(
                self._uptime.unwrapped(time_ms),
                tuple(values[variable] for variable in block.variables),
            )

        config.error_cb.add_callback(refuse)
        config.started_cb.add_callback(note_start)
        config.data_received_cb.add_callback(deliver)
        try:
            backend.log.add_config(config)
            config.start()
        except (AttributeError, KeyError) as error:
            # cflib's own check of what fits on the vehicle.
            raise RefusedError(f"log block {block.name!r}: {error}") from None
        if not decided.wait(REPLY_LIMIT):
            raise NoReplyError(
                f"log block {block.name!r}: the vehicle has not replied within {REPLY_LIMIT:g} s"
            )
        if refusals:
            raise RefusedError(f"log block {block.name!r}: the vehicle answers: {refusals[0]}")
        link.monitor.expect_log(block.period_ms / 1000.0, time.monotonic())
