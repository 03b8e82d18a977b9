"""The set-up of a connection: its progress and its time limits."""

import struct
import time
from dataclasses import dataclass

from cflib.crazyflie.param import MISC_CHANNEL, READ_CHANNEL
from cflib.crazyflie.toc import CMD_TOC_INFO_V2, CMD_TOC_ITEM_V2, TOC_CHANNEL
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import NoAnswerError, SetupError
from crazyflie_link.link_monitor import LOST_AFTER

OLDEST_PROTOCOL = 4  #: The first protocol version with tables of more than 255 items.

_TABLES = {CRTPPort.LOGGING: "log table", CRTPPort.PARAM: "parameter table"}


@dataclass(frozen=True)
class Limits:
    """Time limits of a connection, s.

    The first answer is the time from opening the link to the first packet; stall that without
    progress, while tables and parameter values are read; total that of the whole set-up. A link is
    lost when the last packet is older than ``lost``.
    """

    first_answer: float = 2.0
    stall: float = 1.5
    total: float = 30.0
    lost: float = LOST_AFTER


class LinkSetup:
    """The present step of a connection's set-up, by the packets that arrive."""

    def __init__(self, uri: str, limits: Limits):
        self._uri = uri
        self._limits = limits
        self._step = "waiting for the first answer"
        self._sizes: dict[int, int] = {}
        self._values: set[bytes] = set()
        self._has_answered = False
        self.begin()

    def begin(self) -> None:
        """Start the time limits."""
        self._begin = self._progress_time = time.monotonic()

    def receive(self, port: int, channel: int, data: bytes) -> None:
        """Take note of a packet from the vehicle."""
        if self._advances(port, channel, data) or not self._has_answered:
            self._progress_time = time.monotonic()
        self._has_answered = True

    def check(self, protocol: int) -> None:
        """Raise `NoAnswerError` or `SetupError` if the set-up cannot succeed any more.

        The protocol is negative while it is not known.
        """
        now, limits = time.monotonic(), self._limits
        if 0 <= protocol < OLDEST_PROTOCOL:
            raise SetupError(
                f"{self._uri}: the firmware speaks protocol {protocol}, at least "
                f"{OLDEST_PROTOCOL} is needed: update the firmware"
            )
        if not self._has_answered:
            if now - self._begin > limits.first_answer:
                raise NoAnswerError(
                    f"{self._uri}: no answer has come within {limits.first_answer:g} s, although "
                    "the address can be reached: is it a Crazyflie, is it on, and is no other "
                    "program connected to it?"
                )
        elif now - self._progress_time > limits.stall:
            raise SetupError(
                f"{self._uri}: the vehicle answers, but the connection is stuck ({self._step}) "
                f"for {limits.stall:g} s: restart the vehicle, come nearer or try another channel"
            )
        elif now - self._begin > limits.total:
            raise SetupError(
                f"{self._uri}: not connected after {limits.total:g} s ({self._step}): the link "
                "is too slow; try another channel or a higher data rate"
            )

    def _advances(self, port, channel, data):
        if channel == TOC_CHANNEL and port in _TABLES and data:
            return self._read_table(port, data)
        if port == CRTPPort.MEM:
            self._step = "list of memories"
            return True
        if (port, channel) == (CRTPPort.PARAM, READ_CHANNEL):
            # A value that comes again is no progress.
            known = len(self._values)
            self._values.add(bytes(data[:2]))
            total = self._sizes.get(port, 0)
            self._step = f"parameter values, {len(self._values)} of {total}"
            return len(self._values) > known
        if (port, channel) == (CRTPPort.PARAM, MISC_CHANNEL):
            self._step = "parameter types"
            return True
        return False

    def _read_table(self, port, data):
        if len(data) < 3 or data[0] not in (CMD_TOC_INFO_V2, CMD_TOC_ITEM_V2):
            return False
        (number,) = struct.unpack_from("<H", data, 1)
        before, size = self._step, self._sizes.get(port, 0)
        if data[0] == CMD_TOC_INFO_V2:
            self._sizes[port] = number
            self._step = f"{_TABLES[port]} of {number} items"
        else:
            self._step = f"{_TABLES[port]}, item {number + 1} of {size}"
        return self._step != before
