"""A connection to a motion capture system, and the thread that keeps it alive."""

import threading
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable

from mocap_optitrack.frames import Frame

_SILENCE = 1.0  #: Time without a frame after which a connection is reported (s).

#: Time without a frame after which a connection is reopened (s): the server may have moved, or a
#: network interface may have left its multicast groups.
_RECONNECT_AFTER = 10.0

_RETRY = 1.0  #: Time from a failure to the next attempt (s).
_POLL = 0.1  #: Longest wait of a source for a frame, after which `Receiver.stop` is checked (s).
_STOP_LIMIT = 0.5  #: Longest wait of `Receiver.stop` for the thread (s).


class SourceError(Exception):
    """A motion capture system cannot be used; the text says why and what to do."""


class Source(ABC):
    """One connection to one system. All of it is used from a single thread."""

    @abstractmethod
    def open(self) -> str:
        """Connect, within a few seconds, and return the server's name; or raise `SourceError`."""

    @abstractmethod
    def read(self, limit: float) -> Frame | None:
        """Return the next frame; None if none comes within about ``limit`` seconds.

        `SourceError`: the connection has ended.
        """

    @property
    @abstractmethod
    def silence_hint(self) -> str:
        """Possible causes when no frames come over an open connection."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect; also after a failure of `open`."""


class Receiver:
    """A thread that hands over frames and reconnects when necessary.

    Parameters
    ----------
    make_source : callable
        Returns a new `Source`.
    on_connected, on_silence, on_failure : callable
        Called with a text: what `Source.open` returned; why an open connection may have had
        no frame for a while; why a connection has failed or ended, before the next attempt.
    on_frame : callable
        Called with every `Frame`.
    """

    def __init__(
        self,
        make_source: Callable[[], Source],
        on_connected: Callable[[str], None],
        on_frame: Callable[[Frame], None],
        on_silence: Callable[[str], None],
        on_failure: Callable[[str], None],
    ):
        self._make_source = make_source
        self._on_connected = on_connected
        self._on_frame = on_frame
        self._on_silence = on_silence
        self._on_failure = on_failure
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="motion capture", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread; returns after half a second even if it is still busy."""
        self._stopping.set()
        # The thread itself may be running the callbacks that end the node.
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_STOP_LIMIT)

    def _run(self):
        while not self._stopping.is_set():
            source = self._make_source()
            try:
                self._on_connected(source.open())
                self._receive(source)
            except SourceError as error:
                self._on_failure(str(error))
            except Exception:
                # The thread must continue, whatever a system or a library raises.
                self._on_failure(f"motion capture failed\n{traceback.format_exc()}")
            finally:
                source.close()
            self._stopping.wait(_RETRY)

    def _receive(self, source):
        last = time.monotonic()
        is_reported = False
        while not self._stopping.is_set():
            frame = source.read(_POLL)
            silence = time.monotonic() - last
            if frame is not None:
                last = time.monotonic()
                is_reported = False
                self._on_frame(frame)
            elif silence > _RECONNECT_AFTER:
                raise SourceError(f"no frames for {_RECONNECT_AFTER:g} s; {source.silence_hint}")
            elif silence > _SILENCE and not is_reported:
                is_reported = True
                self._on_silence(f"no frames for {_SILENCE:g} s; {source.silence_hint}")
