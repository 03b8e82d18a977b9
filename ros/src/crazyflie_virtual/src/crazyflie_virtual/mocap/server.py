"""The NatNet server."""

import select
import socket
import time
from collections import deque
from collections.abc import Callable

from typing_extensions import override

from crazyflie_model.angles import Triple
from crazyflie_virtual.mocap import natnet
from crazyflie_virtual.mocap.natnet import BodyPose, Encoder
from crazyflie_virtual.mocap.scene import Scene
from crazyflie_virtual.mocap.settings import MocapSettings
from crazyflie_virtual.observer import decode
from crazyflie_virtual.server import Address, Server, open_socket, received, send

_CLIENT_LIMIT = 5.0  #: How long after its last message a client is sent frames, s.
_LONGEST_WAIT = 0.1  #: s.


class MocapServer(Server):
    """Streams what a `Scene` shows; OSError if a port is taken, or an address is none.

    ``warn`` is not used: the server does not fall behind.
    """

    def __init__(self, settings: MocapSettings, warn: Callable[[str], None] | None = None):
        self._settings = settings
        _check_address("multicast_address", settings.multicast_address)
        self.switches = settings.switches()
        noise = (settings.position_noise, settings.attitude_noise)
        self._scene = Scene(
            self.switches, *noise, settings.seed, settings.single_markers, settings.rate
        )
        self._encoder = Encoder(settings.version)
        self._commands = open_socket(settings.host, settings.command_port)
        try:
            self._observations = open_socket("127.0.0.1", settings.observer_port)
        except OSError:
            self._commands.close()
            raise
        super().__init__(self._commands, self._observations)
        self.address = self._commands.getsockname()  #: Host and port for commands.
        #: Where the vehicles' true poses arrive.
        self.observer_port = self._observations.getsockname()[1]
        if settings.multicast:
            interface = socket.inet_aton(settings.host)
            self._commands.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        self._clients: dict[Address, float] = {}
        self._period = 1.0 / settings.rate
        self._begin = time.monotonic()
        self._frames = 0
        self._pending: deque[tuple[float, float, int, list[BodyPose], list[Triple]]] = deque()

    @property
    @override
    def description(self) -> str:
        s = self._settings
        host, port = self.address
        way = f"multicast to {s.multicast_address}:{s.data_port}" if s.multicast else "unicast"
        return f"virtual motion capture: NatNet {s.version} at {host}:{port}, {way}"

    @override
    def serve(self) -> None:
        wake = self._begin + (self._frames + 1) * self._period
        if self._pending:
            wake = min(wake, self._pending[0][0])
        wait = min(max(0.0, wake - time.monotonic()), _LONGEST_WAIT)
        ready, _, _ = select.select([self._commands, self._observations], [], [], wait)
        if self._observations in ready:
            self._receive_observations()
        if self._commands in ready:
            self._receive_commands(time.monotonic())
        self._expose(time.monotonic())
        self._dispatch(time.monotonic())

    def _receive_observations(self):
        for datagram, _ in received(self._observations):
            observation = decode(datagram)
            if observation is not None:
                self._scene.observe(observation)

    def _receive_commands(self, now):
        for datagram, client in received(self._commands):
            message = natnet.parse(datagram)
            if message is None:
                continue
            self._clients[client] = now
            number, payload = message
            answer = self._answer(number, payload, now)
            if answer is not None:
                send(self._commands, answer, client)

    def _answer(self, number, payload, now):
        settings = self._settings
        if number == natnet.KEEP_ALIVE:
            return None
        if number == natnet.CONNECT:
            group = settings.multicast_address if settings.multicast else None
            return self._encoder.server_info("virtual_mocap", settings.data_port, group)
        if number == natnet.REQUEST_MODEL:
            return self._encoder.model(self._scene.bodies(now))
        if number == natnet.ECHO_REQUEST:
            return natnet.echo(payload, now)
        return natnet.unrecognized()

    def _expose(self, now):
        frame = int((now - self._begin) / self._period)
        if frame <= self._frames:
            return
        # Frames that were missed are missing, as those of a busy system.
        self._frames = frame
        exposure = self._begin + frame * self._period
        if self.switches.silent:
            return
        seen = self._scene.bodies(exposure), self._scene.markers(exposure)
        self._pending.append((exposure + self._settings.latency, exposure, frame, *seen))

    def _dispatch(self, now):
        while self._pending and self._pending[0][0] <= now:
            _, exposure, frame, bodies, markers = self._pending.popleft()
            message = self._encoder.frame(frame, bodies, exposure, exposure, now, markers)
            for receiver in self._receivers(now):
                send(self._commands, message, receiver)

    def _receivers(self, now):
        settings = self._settings
        if settings.multicast:
            return [(settings.multicast_address, settings.data_port)]
        self._clients = {c: t for c, t in self._clients.items() if now - t < _CLIENT_LIMIT}
        return list(self._clients)


def _check_address(name, text):
    try:
        socket.inet_aton(text)
    except OSError:
        raise OSError(f"{name} is {text!r}; expected an IPv4 address") from None
