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
from mocap_optitrack.mocap_parameters import NatNetParameters
from mocap_optitrack.source import Source, SourceError


def _interface_towards(address: str) -> str:
    # Address of this machine's interface that leads to another address. OSError if no route does,
    # PermissionError for a broadcast. Nothing is sent.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect((address, 1))
        return str(probe.getsockname()[0])


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
        self._group: tuple[str, int] | None = None
        self._names: dict[int, str] = {}
        self._wants_names = True
        # What is done again and again -> when it was done last, s.
        self._done_at: dict[int | str, float] = {}

    @override
    def open(self) -> str:
        try:
            targets = self._targets()
            self._sender = self._configured_sender(targets[0])
            self._commands = self._udp_socket()
            self._commands.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            self._commands.bind((self._interface(), 0))
            self._info = self._ask_for_server(targets)
            # The server's own values are used; older servers do not report them.
            address = self._info.multicast_address or self._parameters.multicast_address
            if self._info.is_multicast is not False and address is not None:
                self._group = (address, self._info.data_port or self._parameters.data_port)
                self._join_group(*self._group)
            self._done_at[natnet.CONNECT] = time.monotonic()
        except OSError as error:
            raise SourceError(f"cannot open a NatNet connection: {error}") from None
        return self._description()

    @override
    def read(self, limit: float) -> Frame | None:
        try:
            if self._server is not None:
                self._send_requests()
            return self._receive(self._sockets, limit, self._take)
        except OSError as error:
            raise SourceError(f"the NatNet connection failed: {error}") from None

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

    def _configured_sender(self, target):
        # None where any address may answer: without an address, to a group or a broadcast.
        if self._parameters.server_address is None or ipaddress.ip_address(target).is_multicast:
            return None
        try:
            _interface_towards(target)
        except PermissionError:
            return None
        except OSError:
            # Without a route, sending fails with the reason.
            pass
        return target

    def _interface(self):
        if self._parameters.local_address is not None:
            return self._parameters.local_address
        with contextlib.suppress(OSError):
            if self._sender is not None:
                return _interface_towards(self._sender)
        return _ALL_INTERFACES

    def _join_group(self, address, port):
        receiver = self._udp_socket()
        # Other programs on this machine may listen to the same group.
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        receiver.bind((address, port))
        membership = socket.inet_aton(address) + socket.inet_aton(self._interface())
        receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)

    def _ask_for_server(self, targets):
        if self._parameters.local_address is not None:
            interface = socket.inet_aton(self._parameters.local_address)
            self._commands.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        end = time.monotonic() + _ANSWER_LIMIT
        while (now := time.monotonic()) < end:
            if self._is_due(natnet.CONNECT, _ASK_AGAIN):
                self._send_connect(targets)
            # Datagrams that are not an answer do not put off the next request.
            until = min(end, self._done_at[natnet.CONNECT] + _ASK_AGAIN)
            if info := self._receive([self._commands], until - now, self._take_answer):
                return info
        # A group has frames even if the server does not answer.
        parameters = self._parameters
        if parameters.version is not None and parameters.multicast_address is not None:
            return natnet.ServerInfo("a server that does not answer", parameters.version)
        raise SourceError(
            f"no NatNet server answers at {' or '.join(targets)}, UDP port "
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

    def _send_requests(self):
        if not self._info.is_multicast and self._is_due(natnet.KEEP_ALIVE, _KEEP_ALIVE):
            self._send(natnet.KEEP_ALIVE)
        if self._wants_names and self._is_due(natnet.REQUEST_MODEL, _NAMES_AGAIN):
            self._send(natnet.REQUEST_MODEL)
        if self._is_due(natnet.CONNECT, _SILENCE):
            self._send(natnet.CONNECT, "Ping")

    def _is_due(self, what, interval):
        now = time.monotonic()
        if now - self._done_at.get(what, -math.inf) < interval:
            return False
        self._done_at[what] = now
        return True

    def _send(self, number, text=""):
        # A short failure of the network is treated as silence.
        with contextlib.suppress(OSError):
            self._commands.sendto(natnet.request(number, text), self._server)

    def _receive(self, sockets, limit, take):
        # What the first of the server's messages within a time gives to which ``take(number,
        # payload, sender, arrival)`` does not return None.
        ready, _, _ = select.select(sockets, [], [], limit)
        for each in ready:
            datagram, sender = each.recvfrom(_LARGEST)
            arrival = self._clock()
            if self._sender not in (None, sender[0]):
                if self._is_due("warning", _FOREIGN_AGAIN):
                    self._warn(
                        f"ignoring a datagram from {sender[0]}: the NatNet server is at "
                        f"{self._sender}; if {sender[0]} is the server, name it in "
                        "optitrack_config/server_address"
                    )
                continue
            try:
                taken = take(*natnet.split(datagram), sender, arrival)
            except natnet.DecodeError as error:
                self._warn(f"ignoring a datagram from {sender[0]}: {error}")
                continue
            if taken is not None:
                return taken
        return None

    def _take_answer(self, number, payload, sender, _):
        if number != natnet.SERVER_INFO:
            return None
        info = natnet.read_server_info(payload)
        self._server, self._sender = sender, sender[0]
        return info

    def _take(self, number, payload, sender, arrival):
        info = self._info
        if number == natnet.SERVER_INFO and sender == self._server:
            found = natnet.read_server_info(payload)
            if found != info:
                text = f"{self._where()} is not what it was: {found.name} {found.version}"
                raise SourceError(text)
        if number == natnet.MODEL and self._sender is not None:
            self._names = natnet.read_names(payload, info.version)
            self._wants_names = False
        if number != natnet.FRAME:
            return None
        self._done_at[natnet.CONNECT] = time.monotonic()
        frame = natnet.read_frame(payload, info.version, info.clock_frequency, self._names, arrival)
        self._wants_names |= any(body.name is None for body in frame.bodies)
        self._sender = sender[0]
        return frame

    def _where(self):
        if self._server is None:
            return self._info.name
        address, port = self._server
        return f"{self._info.name} at {address}:{port}"

    def _description(self):
        text = f"{self._where()}, NatNet {self._info.version}, "
        if self._group is None:
            return f"{text}unicast"
        configured = (self._parameters.multicast_address, self._parameters.data_port)
        text += "multicast to {}:{}".format(*self._group)
        if configured[0] is not None and configured != self._group:
            text += " (which overrules the configured {}:{})".format(*configured)
        return text
