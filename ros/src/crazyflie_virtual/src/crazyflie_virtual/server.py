"""What both servers of this package share: UDP sockets, and a thread if wanted."""

import contextlib
import socket
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any

Address = tuple[str, int]  #: Host and port.
_BURST = 256  #: Datagrams taken in at one time, so that a flood does not stop everything else.
_STOP_LIMIT = 2.0  #: How long `Server.stop` waits for the thread, s.


class Server(ABC):
    """A server in real time; `stop` closes its sockets."""

    switches: Any  #: Its attributes are the live fields of the settings.

    def __init__(self, *sockets: socket.socket):
        self._sockets = sockets
        self._is_stopping = False
        self._thread = threading.Thread(target=self.run, name=type(self).__name__, daemon=True)

    @property
    @abstractmethod
    def description(self) -> str:
        """Where clients find the server."""

    @abstractmethod
    def serve(self) -> None:
        """Process what has arrived and is due, after a wait of 0.1 s at most."""

    def run(self) -> None:
        """Serve until `stop`."""
        while not self._is_stopping:
            self.serve()

    def start(self) -> None:
        """Run in a thread of its own until `stop`."""
        self._thread.start()

    def stop(self) -> None:
        """End, and close the sockets."""
        self._is_stopping = True
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(_STOP_LIMIT)
        for each in self._sockets:
            each.close()


def open_socket(host: str, port: int) -> socket.socket:
    """Return a non-blocking UDP socket on a port, 0 for a free one; OSError names host and port."""
    result = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        result.bind((host, port))
    except OSError as error:
        result.close()
        raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from None
    result.setblocking(False)
    return result


def received(source: socket.socket) -> Iterator[tuple[bytes, Address]]:
    """Yield (datagram, sender) for what has arrived at a socket."""
    for _ in range(_BURST):
        try:
            yield source.recvfrom(65536)
        except BlockingIOError:
            return
        except ConnectionError:
            # Packets were sent before the port was open.
            continue


def send(source: socket.socket, datagram: bytes, receiver: Address) -> None:
    """Send a datagram; one that the network does not take is one that is lost."""
    with contextlib.suppress(OSError):
        source.sendto(datagram, receiver)
