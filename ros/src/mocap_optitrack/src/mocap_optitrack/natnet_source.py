"""NatNet servers, such as OptiTrack's Motive: sockets, connection and frames."""

import contextlib
import ipaddress
import math
import select
import socket
import time
from collections.abc import Callable

from typing_extensions import override

from mocap_optitrack import natnet_messages as natnet
from mocap_optitrack.frames import Frame
from mocap_optitrack.parameters import NatNetParameters
from mocap_optitrack.source import Source, SourceError


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
    """Make a UDP socket receive the datagrams to a group at a port, from one interface.

    OSError: the port is taken, or this machine has no such interface.
    """
    # Other programs on this machine may listen to the same group.
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    receiver.bind((address, port))
    membership = socket.inet_aton(address) + socket.inet_aton(interface)
    receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)


_ANSWER_LIMIT = 2.0  #: Longest wait for an answer of the server (s).
_ASK_AGAIN = 0.5  #: Period of requests until an answer comes (s), since datagrams get lost.
_NAMES_AGAIN = 2.0  #: Interval of requests for the names of bodies (s).
#: Without a frame for this long the server is asked again, s: after a restart it has no clients.
_SILENCE = 0.5
_KEEP_ALIVE = 1.0  #: Interval of keep-alives, without which a server stops sending (s).
#: Interval of warnings about datagrams of senders other than the server (s).
_FOREIGN_AGAIN = 5.0

_LARGEST = 65536
_THIS_MACHINE = "127.0.0.1"
_ALL_INTERFACES = "0.0.0.0"


class NatNetSource(Source):
    """A NatNet server, unicast or multicast as the server has it.

    UDP is not authenticated, and every machine in the network can send to the ports. Only datagrams
    from the server's address are used: the configured one, else that of the first server that
    answers, else that of the first frame of the group. ``clock()`` returns the local time, s;
    ``warn(text)`` is called about every datagram that is dropped.
    """

    def __init__(
        self, parameters: NatNetParameters, clock: Callable[[], float], warn: Callable[[str], None]
    ):
        self._parameters = parameters
        self._clock = clock
        self._warn = warn
        self._sockets: list[socket.socket] = []
        self._server: tuple[str, int] | None = None
        self._sender: str | None = None
        self._foreign_warned_at = -math.inf
        self._group: tuple[str, int] | None = None
        self._names: dict[int, str] = {}
        self._wants_names = True
        self._asked_names_at = self._kept_alive_at = self._frame_at = -math.inf

    @override
    def open(self) -> str:
        try:
            targets = self._targets()
            self._sender = self._configured_sender(targets)
            self._commands = self._udp_socket()
            self._commands.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            self._commands.bind((self._interface(), 0))
            self._info = self._ask_for_server(targets) or self._silent_server()
            self._group = self._find_group()
            if self._group is not None:
                address, port = self._group
                join_group(self._udp_socket(), address, port, self._interface())
            self._frame_at = time.monotonic()
        except OSError as error:
            raise SourceError(f"cannot open a NatNet connection: {error}") from None
        return self._description()

    @override
    def read(self, limit: float) -> Frame | None:
        try:
            if self._server is not None:
                self._send_requests()
            ready, _, _ = select.select(self._sockets, [], [], limit)
            for each in ready:
                frame = self._take(*each.recvfrom(_LARGEST), self._clock())
                if frame is not None:
                    return frame
        except OSError as error:
            raise SourceError(f"the NatNet connection failed: {error}") from None
        return None

    @property
    @override
    def silence_hint(self) -> str:
        if self._group is None:
            return (
                f"{self._where()} has answered but sends nothing: does it stream rigid bodies, "
                "and is its recording or live view running?"
            )
        address, port = self._group
        return (
            f"nothing comes to the multicast group {address}:{port}: is streaming on, does a "
            "firewall let UDP pass, and is optitrack_config/local_address the address of this "
            "machine in the cameras' network?"
        )

    @override
    def close(self) -> None:
        for each in self._sockets:
            each.close()
        self._sockets = []

    def _udp_socket(self):
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sockets.append(made)
        return made

    def _targets(self):
        parameters = self._parameters
        if parameters.server_address is None:
            return [a for a in (parameters.multicast_address, _THIS_MACHINE) if a is not None]
        try:
            return [socket.gethostbyname(parameters.server_address)]
        except OSError as error:
            raise SourceError(
                f"optitrack_config/server_address {parameters.server_address!r} is unknown: {error}"
            ) from None

    def _configured_sender(self, targets):
        # None where any address may answer: without an address, to a group or a broadcast.
        address = targets[0]
        if self._parameters.server_address is None or ipaddress.ip_address(address).is_multicast:
            return None
        with contextlib.suppress(OSError):
            if interface_towards(address) is None:
                return None
        return address

    def _interface(self):
        if self._parameters.local_address is not None:
            return self._parameters.local_address
        # Without a route, sending fails with the reason.
        with contextlib.suppress(OSError):
            if self._sender is not None:
                return interface_towards(self._sender) or _ALL_INTERFACES
        return _ALL_INTERFACES

    def _ask_for_server(self, targets):
        if self._parameters.local_address is not None:
            interface = socket.inet_aton(self._parameters.local_address)
            self._commands.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        end = time.monotonic() + _ANSWER_LIMIT
        ask_at = 0.0
        while (now := time.monotonic()) < end:
            if now >= ask_at:
                self._send_connect(targets)
                ask_at = now + _ASK_AGAIN
            ready, _, _ = select.select([self._commands], [], [], min(end, ask_at) - now)
            if not ready:
                continue
            datagram, sender = self._commands.recvfrom(_LARGEST)
            if self._sender not in (None, sender[0]):
                self._warn_of_sender(sender[0])
                continue
            # Other datagrams are skipped; if nothing else comes, the caller reports that.
            with contextlib.suppress(natnet.DecodeError):
                number, payload = natnet.split(datagram)
                if number == natnet.SERVER_INFO:
                    info = natnet.read_server_info(payload)
                    self._server = sender
                    self._sender = sender[0]
                    return info
        return None

    def _silent_server(self):
        # A group has frames even if the server does not answer.
        parameters = self._parameters
        if parameters.version is not None and parameters.multicast_address is not None:
            return natnet.ServerInfo("a server that does not answer", parameters.version)
        raise SourceError(
            f"no NatNet server answers at {' or '.join(self._targets())}, UDP port "
            f"{parameters.command_port}: is Motive running and streaming, is "
            "optitrack_config/server_address right, and does a firewall let UDP pass?"
        )

    def _send_connect(self, targets):
        port = self._parameters.command_port
        failures = []
        for target in targets:
            try:
                self._commands.sendto(natnet.request(natnet.CONNECT, "Ping"), (target, port))
            except OSError as error:
                failures.append(f"{target}: {error.strerror}")
        if len(failures) == len(targets):
            raise SourceError(f"cannot send to the NatNet server at {', '.join(failures)}")

    def _find_group(self):
        # The server's own values are used; older servers do not report them.
        info, parameters = self._info, self._parameters
        if info.is_multicast is False:
            return None
        address = info.multicast_address or parameters.multicast_address
        if address is None:
            return None
        return address, info.data_port or parameters.data_port

    def _send_requests(self):
        now = time.monotonic()
        if not self._info.is_multicast and now - self._kept_alive_at >= _KEEP_ALIVE:
            self._kept_alive_at = now
            self._send(natnet.KEEP_ALIVE)
        if self._wants_names and now - self._asked_names_at >= _NAMES_AGAIN:
            self._asked_names_at = now
            self._send(natnet.REQUEST_MODEL)
        if now - self._frame_at >= _SILENCE:
            self._frame_at = now
            self._send(natnet.CONNECT, "Ping")

    def _send(self, number, text=""):
        # A short failure of the network is treated as silence.
        with contextlib.suppress(OSError):
            self._commands.sendto(natnet.request(number, text), self._server)

    def _take(self, datagram, sender, arrival):
        if self._sender not in (None, sender[0]):
            self._warn_of_sender(sender[0])
            return None
        try:
            number, payload = natnet.split(datagram)
            if number == natnet.SERVER_INFO and sender == self._server:
                info = natnet.read_server_info(payload)
                if info != self._info:
                    text = f"{self._where()} is not what it was: {info.name} {info.version}"
                    raise SourceError(text)
            frame = self._decode(number, payload, arrival)
        except natnet.DecodeError as error:
            self._warn(f"ignoring a datagram from {sender[0]}: {error}")
            return None
        if frame is not None:
            self._sender = sender[0]
        return frame

    def _warn_of_sender(self, address):
        now = time.monotonic()
        if now - self._foreign_warned_at >= _FOREIGN_AGAIN:
            self._foreign_warned_at = now
            self._warn(
                f"ignoring a datagram from {address}: the NatNet server is at {self._sender}; if "
                f"{address} is the server, name it in optitrack_config/server_address"
            )

    def _decode(self, number, payload, arrival):
        info = self._info
        if number == natnet.MODEL and self._sender is not None:
            self._names = natnet.read_names(payload, info.version)
            self._wants_names = False
        if number != natnet.FRAME:
            return None
        self._frame_at = time.monotonic()
        frame = natnet.read_frame(payload, info.version, info.clock_frequency, self._names, arrival)
        self._wants_names |= any(body.name is None for body in frame.bodies)
        return frame

    def _where(self):
        if self._server is None:
            return self._info.name
        address, port = self._server
        return f"{self._info.name} at {address}:{port}"

    def _description(self):
        where = self._where()
        if self._group is None:
            return f"{where}, NatNet {self._info.version}, unicast"
        address, port = self._group
        text = f"{where}, NatNet {self._info.version}, multicast to {address}:{port}"
        configured = (self._parameters.multicast_address, self._parameters.data_port)
        if None not in configured and configured != self._group:
            text += f" (which overrules the configured {configured[0]}:{configured[1]})"
        return text
