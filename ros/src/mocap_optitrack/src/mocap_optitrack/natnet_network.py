"""UDP sockets and addresses of a NatNet client."""

import contextlib
import ipaddress
import socket


def any_address_may_answer(address: str) -> bool:
    """Return whether an IPv4 address is that of a group or a broadcast."""
    if ipaddress.ip_address(address).is_multicast:
        return True
    with contextlib.suppress(OSError):
        return interface_towards(address) is None
    return False


def interface_towards(address: str) -> str | None:
    """Return the address of this machine's interface that leads to another address.

    None for a broadcast address; OSError if no route leads there.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # Nothing is sent. Linux refuses broadcasts on a socket without SO_BROADCAST.
            probe.connect((address, 1))
        except PermissionError:
            return None
        return str(probe.getsockname()[0])


def join_group(receiver: socket.socket, address: str, port: int, interface: str) -> None:
    """Let a UDP socket receive the datagrams to a group at a port, from one interface.

    OSError: the port is taken, or this machine has no such interface.
    """
    # Other programs on this machine may listen to the same group.
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    receiver.bind((address, port))
    membership = socket.inet_aton(address) + socket.inet_aton(interface)
    receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
