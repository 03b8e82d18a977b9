"""UDP sockets as both servers use them."""

import contextlib
import socket
from collections.abc import Iterator

Address = tuple[str, int]
"""Host and port."""

_BURST = 256
"""Datagrams taken in at one time, so that a flood does not stop everything else."""


def open_socket(host: str, port: int) -> socket.socket:
    """Return a non-blocking UDP socket on a port; 0 for a free one.

    Raises
    ------
    OSError
        The text names host and port.
    """
    result = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        result.bind((host, port))
    except OSError as error:
        result.close()
        raise OSError(error.errno, f"{host}:{port}: {error.strerror}") from None
    result.setblocking(False)
    return result


def received(source: socket.socket) -> Iterator[tuple[bytes, Address]]:
    """Yield (datagram, sender) for what waits in a socket."""
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
