"""One connection to a vehicle, from its set-up to its end."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link import radios
from crazyflie_link.address import Address
from crazyflie_link.backend import Backend, init_drivers, packet
from crazyflie_link.errors import (
    UNANSWERED,
    CrazyflieError,
    LinkLostError,
    NoAnswerError,
    SetupError,
    ValueRangeError,
    explain,
)
from crazyflie_link.exchange import Exchange, Request
from crazyflie_link.liveness import LOST_AFTER, Life, Liveness
from crazyflie_link.outbox import Outbox, Send
from crazyflie_link.setup_progress import SetupProgress

OLDEST_PROTOCOL = 4
"""The first protocol version with tables of more than 255 items."""

LOG_DATA = (CRTPPort.LOGGING, 2)
"""Port and channel of log data."""

_PING_CHANNEL = 0
_SOURCE_PERIOD = 0.1
_MOST_DATA = 30

_log = logging.getLogger(__name__)

OnPacket = Callable[[int, int, bytes], None]
"""Is called with port, channel and data."""


@dataclass(frozen=True)
class Limits:
    """Time limits of a connection, s.

    Attributes
    ----------
    first_answer : float
        From opening the link to the first packet.
    stall : float
        Without progress, while tables and parameter values are read.
    total : float
        For the whole set-up.
    lost : float
        Age of the last sign of life at which a link is lost.
    """

    first_answer: float = 2.0
    stall: float = 1.5
    total: float = 30.0
    lost: float = LOST_AFTER


class Link:
    """A connection that is opened once and closed once.

    Parameters
    ----------
    address : Address
    limits : Limits
    cache : str or None
        Folder of the tables.
    on_packet : callable, optional
        ``on_packet(port, channel, data)`` for every packet, from cflib's thread.
    backend : callable
        What makes the object of cflib: ``backend(cache, on_error)``.
    """

    def __init__(
        self,
        address: Address,
        limits: Limits | None = None,
        cache: str | None = None,
        on_packet: OnPacket | None = None,
        backend: Callable[[str | None, Callable[[str], None]], Backend] = Backend,
    ):
        self.address = address
        self._liveness: Liveness | None = None
        self._limits = limits or Limits()
        self._on_packet = on_packet
        self._changed = threading.Condition()
        self._error: CrazyflieError | None = None
        self._is_connected = False
        self._is_complete = False
        self._progress = SetupProgress()
        self._progress_time = 0.0
        self._has_answered = False
        self._radio_says = ""
        self._closing = threading.Lock()
        self._is_closed = False
        self._exchange = Exchange()
        self._outbox = Outbox()
        self.cflib = backend(cache, self._fail)
        self.cflib.packet_received.add_callback(self._on_received)
        self.cflib.packet_sent.add_callback(self._on_sent)
        self.cflib.connected.add_callback(self._on_connected)
        self.cflib.fully_connected.add_callback(self._on_complete)
        self.cflib.connection_failed.add_callback(lambda _, text: self._fail(text))

    # Set-up.

    def open(self) -> None:
        """Connect: find the vehicle, read its tables and parameters; blocks.

        Raises
        ------
        CrazyflieError
            With the reason and what to do; the link is closed.
        """
        try:
            self._open()
        except BaseException as error:
            self.close(str(error))
            raise

    def _open(self):
        init_drivers()
        begin = self._progress_time = time.monotonic()
        # A dongle that hangs, or the search for a host's name, may block.
        threading.Thread(target=self._open_cflib, name="crazyflie-open", daemon=True).start()
        asked = begin
        with self._changed:
            while not self._is_complete:
                self._changed.wait(0.05)
                now = time.monotonic()
                self._check_setup(now, begin)
                if self.protocol < 0 and now - asked > _SOURCE_PERIOD:
                    asked = now
                    self._outbox.latest("source", self.cflib.ask_for_source)

    def _open_cflib(self):
        radios.forget_dead_radios()
        self.cflib.open_link(self.address.uri)
        # `open` may have given up meanwhile.
        if self._is_closed:
            self.cflib.drop()

    def _check_setup(self, now, begin):
        uri = self.address.uri
        if self._error is not None:
            raise self._error
        if 0 <= self.protocol < OLDEST_PROTOCOL:
            raise SetupError(
                f"{uri}: the firmware speaks protocol {self.protocol}, at least {OLDEST_PROTOCOL} "
                "is needed: update the firmware"
            )
        if not self._has_answered:
            if now - begin > self._limits.first_answer:
                raise NoAnswerError(
                    f"{uri}: nobody has answered within {self._limits.first_answer:g} s, although "
                    "the address can be reached: is it a Crazyflie, is it on, and is nobody else "
                    "connected to it?"
                )
        elif now - self._progress_time > self._limits.stall:
            raise SetupError(
                f"{uri}: the vehicle answers, but the connection is stuck ({self._progress}) for "
                f"{self._limits.stall:g} s: restart the vehicle, come nearer or try another channel"
            )
        elif now - begin > self._limits.total:
            raise SetupError(
                f"{uri}: not connected after {self._limits.total:g} s ({self._progress}): the link "
                "is too slow; try another channel or a higher data rate"
            )

    def _on_connected(self, _):
        with self._changed:
            self._is_connected = True
            self._liveness = Liveness(time.monotonic(), self._limits.lost)
            # Without a single parameter cflib never reports that it is complete.
            if not self.cflib.param.toc.toc:
                self._is_complete = True
            self._changed.notify_all()

    def _on_complete(self, _):
        with self._changed:
            self._is_complete = True
            self._changed.notify_all()

    # Operation.

    @property
    def protocol(self) -> int:
        """Version of the protocol that the vehicle speaks."""
        return self.cflib.platform.get_protocol_version()

    @property
    def liveness(self) -> Liveness:
        """Signs of life of the vehicle.

        Raises
        ------
        LinkLostError
            The link is not set up.
        """
        if self._liveness is None:
            raise LinkLostError(f"{self.address.uri}: not connected yet")
        return self._liveness

    @property
    def error(self) -> CrazyflieError | None:
        """Why the link is at its end; None while it lives."""
        return self._error

    def life(self) -> tuple[Life, str]:
        """Return what the vehicle's packets show, and the same in words."""
        if self._liveness is None:
            return Life.ALIVE, "not connected yet"
        state = self._liveness.state(time.monotonic())
        if state is Life.ALIVE:
            return state, "connected"
        if state is Life.RESTARTED:
            text = "the log data have stopped although the vehicle answers: has it restarted?"
        else:
            text = f"the vehicle has not been heard for {self._limits.lost:g} s{self._radio_says}"
        return state, f"{self.address.uri}: {text}"

    def stream(self, name: str, send: Send) -> None:
        """Have ``send()`` called soon, in the place of what still waits under this name."""
        self._outbox.latest(name, send)

    def forget(self, name: str) -> None:
        """Do not send what waits under this name."""
        self._outbox.forget(name)

    def command(self, send: Send, urgent: bool = False) -> None:
        """Have ``send()`` called soon, after earlier commands, or before them if urgent."""
        self._outbox.command(send, urgent)

    def send(self, port: int, channel: int, data: bytes) -> None:
        """Send a packet with at most 30 bytes of data."""
        if not (0 <= port <= 15 and 0 <= channel <= 3 and len(data) <= _MOST_DATA):
            raise ValueRangeError(
                f"no packet: port {port} (0 to 15), channel {channel} (0 to 3), {len(data)} bytes "
                f"(at most {_MOST_DATA})"
            )
        self.command(lambda: self.cflib.send_packet(packet(port, channel, data)))

    def ask(self, send: Send | bytes, request: Request) -> bytes:
        """Send a request and return the data of its answer; see `Exchange.ask`.

        Parameters
        ----------
        send : callable or bytes
            Sends the request; or its data, for the same port and channel.
        request : Request
            What answer is expected.
        """
        if isinstance(send, bytes):
            data = packet(request.port, request.channel, send)
            transmit = lambda: self.cflib.send_packet(data)  # noqa: E731
        else:
            transmit = send
        return self._exchange.ask(lambda: self.command(transmit), request)

    # End.

    def close(self, reason: str = "the link was closed") -> None:
        """End the connection, once; requests that wait fail with the reason."""
        with self._closing:
            if self._is_closed:
                return
            self._is_closed = True
        with self._changed:
            self._error = self._error or LinkLostError(reason)
            self._changed.notify_all()
        self._outbox.close()
        self._exchange.close(reason)
        self.cflib.drop()

    def _fail(self, text):
        with self._changed:
            if self._error is None:
                cause = explain(self.address.uri, text)
                if self._is_complete and UNANSWERED in text.lower():
                    # The driver goes on, and the vehicle may be heard again.
                    self._radio_says = f" ({cause})"
                    return
                if self._is_connected:
                    cause = LinkLostError(f"the link was lost: {cause}")
                self._error = cause
            self._changed.notify_all()

    # An exception in here would end cflib's receiving thread.

    def _on_received(self, received):
        self._radio_says = ""
        port, channel, data = received.port, received.channel, bytes(received.data)
        now = time.monotonic()
        if not self._is_complete:
            is_progress = self._progress.receive(port, channel, data)
            if is_progress or not self._has_answered:
                self._progress_time = now
            self._has_answered = True
        if self._liveness is not None:
            if (port, channel) == LOG_DATA:
                self._liveness.log_received(now)
            elif (port, channel) == (CRTPPort.LINKCTRL, _PING_CHANNEL):
                self._liveness.ping_answered(data, now)
        self._exchange.receive(port, channel, data)
        if self._on_packet is not None:
            try:
                self._on_packet(port, channel, data)
            except Exception:
                _log.exception("the callback for packets failed")

    def _on_sent(self, sent):
        if self._liveness is not None and (sent.port, sent.channel) == (
            CRTPPort.LINKCTRL,
            _PING_CHANNEL,
        ):
            self._liveness.ping_sent(bytes(sent.data))
