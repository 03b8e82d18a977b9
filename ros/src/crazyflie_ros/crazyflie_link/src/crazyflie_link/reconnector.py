"""The link to a vehicle: opened, watched, and opened anew after a loss."""

import enum
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from crazyflie_link.errors import CrazyflieError, LinkLostError
from crazyflie_link.link import Link
from crazyflie_link.link_monitor import LinkHealth
from crazyflie_link.safe_crazyflie import CLOSE_LIMIT

CHECK_PERIOD = 0.05  #: Period of the watch, s.

_JOIN_LIMIT = 0.3

#: How long, in s, a silent link is kept: one on which the vehicle is heard again needs no set-up.
#: Silence of up to 1.4 s ends that way before 2 s, when the firmware locks; setting up a new link
#: can take a second on a busy machine.
SILENCE_LIMIT = 1.0

#: Pause after the first failed attempt to connect again, and the longest one, s; each is twice the
#: one before.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0


class LinkState(enum.Enum):
    """State of the link to a vehicle."""

    DISCONNECTED = "disconnected"
    CONNECTING = "connecting"
    CONNECTED = "connected"
    LOST = "lost"


@dataclass(eq=False)
class Reconnector:
    """Keep a link to a vehicle; the first `connect` succeeds or raises.

    ``make_link()`` returns a new `Link`; ``restore()`` does on one that was opened anew what the
    vehicle has forgotten, and returns what it could not do; ``is_urgent()`` returns whether to
    connect again without pauses. ``opening`` is the link that is being opened,
    ``connection_count`` how many times one has been set up.
    """

    _uri: str
    _make_link: Callable[[], Link]
    _restore: Callable[[], str]
    _is_urgent: Callable[[], bool]
    _on_state: Callable[[LinkState, str], None] | None
    _is_persistent: bool
    state: LinkState = LinkState.DISCONNECTED
    opening: Link | None = None
    connection_count: int = 0
    _link: Link | None = None
    _silent_since: float | None = None
    _reason: str = "not connected yet"
    _reported: tuple[LinkState, str] | None = None
    _closed: threading.Event = field(default_factory=threading.Event)
    _closing: threading.Thread | None = None
    _watcher: threading.Thread | None = None

    def connect(self) -> None:
        """Connect for the first time; see `Crazyflie.connect`."""
        if self._watcher is not None or self._closed.is_set():
            raise CrazyflieError(f"{self._uri}: connect can be called once only")
        self._set_state(LinkState.CONNECTING, f"connecting to {self._uri}")
        try:
            self._open()
        except CrazyflieError as error:
            self._set_state(LinkState.DISCONNECTED, str(error))
            raise
        self._set_state(LinkState.CONNECTED, f"connected to {self._uri}")
        self._watcher = threading.Thread(target=self._watch, name="crazyflie-watch", daemon=True)
        self._watcher.start()

    def link(self) -> Link:
        """Return the link on which the vehicle is heard; see `Crazyflie.link`."""
        link = self._link
        if link is None or self._silent_since is not None:
            raise LinkLostError(f"no link to the vehicle: {self._reason}")
        return link

    def any_link(self) -> Link | None:
        """Return the link, also if it is silent or still being opened."""
        return self._link or self.opening

    def close_link(self, reason: str) -> None:
        """Close the present link."""
        link, self._link = self._link, None
        self._reason = reason
        if link is not None:
            link.close(reason)

    def close(self) -> None:
        """End the connection; safe to call twice and while connecting."""
        self._closed.set()
        opening = self.opening
        if opening is not None:
            opening.close()
        self.close_link("the link was closed")
        watcher = self._watcher
        if watcher is not None and watcher is not threading.current_thread():
            watcher.join(timeout=_JOIN_LIMIT)
        if self._closing is not None:
            self._closing.join(timeout=CLOSE_LIMIT)
        self._set_state(LinkState.DISCONNECTED, "the link was closed")

    def _open(self):
        self.opening = link = self._make_link()
        try:
            # `close` looks for it here; if it was called before, it has found nothing.
            self._end_if_closed(link)
            link.open()
        finally:
            self.opening = None
        self._link = link
        self.connection_count += 1
        self._end_if_closed(link)

    def _end_if_closed(self, link):
        if self._closed.is_set():
            self._link = None
            link.close("the link was closed")
            raise LinkLostError("the link was closed while connecting")

    def _watch(self):
        while not self._closed.wait(CHECK_PERIOD):
            link = self._link
            end = LinkLostError(self._reason) if link is None else link.error
            why = str(end)
            if link is not None and end is None:
                health, why = link.health()
                if self._is_usable(health, why):
                    continue
            # First report it: to close the link takes a moment.
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
            if not self._is_persistent or not self._reconnect():
                return

    def _is_usable(self, health, text):
        # Whether the link may stay, for a while at least.
        if health is LinkHealth.ALIVE:
            was_silent = self._silent_since is not None
            self._silent_since = None
            if was_silent:
                self._set_state(LinkState.CONNECTED, f"{self._uri} is heard again")
            return True
        if health is LinkHealth.RESTARTED:
            return False
        now = time.monotonic()
        if self._silent_since is None:
            self._silent_since = now
            self._set_state(LinkState.LOST, text)
        return now - self._silent_since < SILENCE_LIMIT

    def _reconnect(self):
        pause = 0.0
        while not self._has_closed_within(pause):
            pause = min(max(2.0 * pause, FIRST_PAUSE), LONGEST_PAUSE)
            try:
                self._open()
                problems = self._restore()
            except CrazyflieError as error:
                self.close_link(str(error))
                if not self._closed.is_set():
                    self._set_state(LinkState.LOST, str(error))
            else:
                self._set_state(LinkState.CONNECTED, f"connected to {self._uri} again{problems}")
                return True
        return False

    def _has_closed_within(self, pause):
        # An emergency stop does not wait for the next attempt.
        end = time.monotonic() + pause
        while time.monotonic() < end and not self._closed.wait(CHECK_PERIOD):
            if self._is_urgent():
                break
        return self._closed.is_set()

    def _set_state(self, state, text):
        self.state = state
        self._reason = text
        if (state, text) != self._reported:
            self._reported = (state, text)
            if self._on_state is not None:
                self._on_state(state, text)
