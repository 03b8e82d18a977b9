"""The virtual vehicle on a UDP port, in real time.

`Server` and `run_server` are also those of the virtual motion capture system.
"""

import contextlib
import math
import random
import select
import signal
import socket
import struct
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from random import Random
from types import SimpleNamespace
from typing import NamedTuple

from typing_extensions import override

import crazyflie_utils
from crazyflie_model.angles import Quaternion, Triple
from crazyflie_utils.parameters.command_line import parse_arguments
from crazyflie_utils.parameters.declaration import ParameterError, Parameters
from crazyflie_virtual.crtp import is_broadcast
from crazyflie_virtual.settings import FIRST_PORT, VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle

Address = tuple[str, int]  #: Host and port.
#: Largest number of datagrams that are read at once, so that a flood does not block the rest.
_BURST = 256
_STOP_LIMIT = 2.0  #: Longest wait of `Server.stop` for the thread (s).


class Server(ABC):
    """A server in real time; `stop` closes its sockets.

    ``description`` names the server and its address, for the log.
    """

    switches: SimpleNamespace  #: Live fields of the settings, which may be changed.

    def __init__(self, description: str, *sockets: socket.socket):
        self.description = description
        self._sockets = sockets
        self._is_stopping = False
        self._thread = threading.Thread(target=self.run, name=type(self).__name__, daemon=True)

    @abstractmethod
    def serve(self) -> None:
        """Process datagrams and due work, after a wait of at most 0.1 s."""

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
    """Yield (datagram, sender) for all datagrams that have arrived at a socket."""
    for _ in range(_BURST):
        try:
            yield source.recvfrom(65536)
        except BlockingIOError:
            return
        except ConnectionError:
            # Earlier packets were sent before the port was open.
            continue


def send(source: socket.socket, datagram: bytes, receiver: Address) -> None:
    """Send a datagram; it is lost if the network does not accept it."""
    with contextlib.suppress(OSError):
        source.sendto(datagram, receiver)


Item = tuple[bytes, Address]  #: Datagram, and its sender or receiver.


class Channel:
    """Datagrams in transit; ``random`` decides which are lost."""

    def __init__(self, faults: SimpleNamespace, random: Random):
        self._faults = faults
        self._random = random
        self._on_the_way: deque[tuple[float, Item]] = deque()

    def push(self, time: float, item: Item) -> None:
        """Send something at ``time`` (s)."""
        faults = self._faults
        if faults.silence > 0.0 or self._random.random() < faults.loss:
            return
        due = time + max(faults.delay, 0.0)
        if self._on_the_way:
            # Datagrams keep their order, even when the delay has become shorter.
            due = max(due, self._on_the_way[-1][0])
        self._on_the_way.append((due, item))

    def pop(self, time: float) -> list[Item]:
        """Return the datagrams that have arrived at ``time`` (s), oldest first."""
        arrived = []
        while self._on_the_way and self._on_the_way[0][0] <= time:
            arrived.append(self._on_the_way.popleft()[1])
        return [] if self._faults.silence > 0.0 else arrived

    def next_arrival(self) -> float:
        """Return the time of the next arrival, s; infinity without one."""
        return self._on_the_way[0][0] if self._on_the_way else math.inf


def run_server(
    program: str,
    description: str,
    settings_type: type[Parameters],
    server_type: Callable[..., Server],
    node_type: str,
) -> None:
    """Run a server until interrupted: with ROS when roslaunch starts it, without otherwise.

    ``node_type`` is the "package.module:Class" of the node. The command line has the settings.
    """
    # roslaunch gives every node its name this way; parameters for rosrun look alike.
    if any(":=" in argument for argument in sys.argv[1:]):
        crazyflie_utils.run(node_type, program)
    settings = parse_arguments(settings_type, sys.argv[1:], program, description)
    try:
        server = server_type(settings, lambda text: print(text, file=sys.stderr, flush=True))
    except OSError as error:
        sys.exit(f"{program}: cannot listen: {error}")
    except ParameterError as error:
        sys.exit(f"{program}: {error}")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    print(server.description, flush=True)
    try:
        server.run()
    except KeyboardInterrupt:
        # Ctrl-C is the normal end.
        pass


_MAGIC = b"vcf1"
_FORM = struct.Struct("<4sH32s14d")


class Observation(NamedTuple):
    """The true state of a vehicle, which is sent to local observers: motion capture and tests."""

    #: body_id, name: those of the vehicle; the name has at most 31 bytes.
    body_id: int
    name: str
    time: float  #: Time by the machine's monotonic clock, which its processes share (s).
    #: position, velocity: m and m/s, fixed frame.
    position: Triple
    velocity: Triple
    quaternion: Quaternion  #: (x, y, z, w), body to fixed frame.
    rates: Triple  #: Body rates, rad/s.

    def encode(self) -> bytes:
        """Return the observation as a datagram."""
        numbers = (*self.position, *self.velocity, *self.quaternion, *self.rates)
        return _FORM.pack(_MAGIC, self.body_id, self.name.encode()[:31], self.time, *numbers)

    @classmethod
    def decode(cls, datagram: bytes) -> "Observation | None":
        """Return the observation in a datagram, or None."""
        if len(datagram) != _FORM.size or not datagram.startswith(_MAGIC):
            return None
        _, body_id, encoded, time, *n = _FORM.unpack(datagram)
        name = encoded.rstrip(b"\0").decode("utf-8", "replace")
        return cls(body_id, name, time, tuple(n[:3]), tuple(n[3:6]), tuple(n[6:10]), tuple(n[10:]))


_TICK = 0.005  #: Longest time between two steps of the vehicle when no packet comes (s).
#: Longest time that is simulated at once (s); beyond it the vehicle loses time, but keeps its link.
_GREATEST_LAG = 0.25
_NULL = b"\xff"  #: Packet of a scanner, which is not a client.


class VehicleServer(Server):
    """A vehicle behind a socket; OSError if the port is taken.

    ``warn(text)`` is called when the vehicle cannot keep up with the clock.
    """

    def __init__(self, settings: VehicleSettings, warn: Callable[[str], None] = lambda text: None):
        self._socket = open_socket(settings.host, settings.port)
        self.address = self._socket.getsockname()  #: Host and port.
        super().__init__("virtual Crazyflie at udp://{}:{}".format(*self.address), self._socket)
        self._warn = warn
        self.vehicle = VirtualVehicle(settings)
        self.switches = self.vehicle.faults
        source = random.Random(settings.seed)
        self._up = Channel(self.vehicle.faults, source)
        self._down = Channel(self.vehicle.faults, source)
        self._client: Address | None = None
        self._begin = self._last_time = time.monotonic()
        self._observer = (settings.observer_host, settings.observer_port)
        self._observation_period = 1.0 / settings.observer_rate
        self._next_observation = self._begin
        self._observed = -math.inf  # Time of the vehicle at the last observation, s.
        number = _number(self.address[1])
        self._body_id = settings.body_id or number
        self._body_name = settings.body_name or f"cf{number}"

    @override
    def serve(self) -> None:
        datagrams = list(received(self._socket))
        # All received packets were sent before now.
        now = time.monotonic()
        self._process(now, datagrams)
        arrival = min(self._up.next_arrival(), self._down.next_arrival())
        wake = min(now - (now - self._begin) % _TICK + _TICK, arrival)
        select.select([self._socket], [], [], max(0.0, wake - time.monotonic()))

    def observe(self) -> Observation:
        """Return the present true state of the vehicle."""
        physics = self.vehicle.physics
        return Observation(
            self._body_id,
            self._body_name,
            self._begin + self.vehicle.time,
            physics.position,
            physics.velocity,
            physics.quaternion,
            physics.rates,
        )

    def _process(self, now, datagrams):
        faults = self.vehicle.faults
        faults.silence = max(0.0, faults.silence - (now - self._last_time))
        self._last_time = now
        for item in datagrams:
            self._up.push(now, item)
        lag = now - self._begin - self.vehicle.time
        if lag > _GREATEST_LAG:
            self._begin += lag
            self._next_observation += lag
            self._warn(f"the machine is too slow: the vehicle has lost {lag:.2f} s")
        for datagram in self.vehicle.advance_to(now - self._begin):
            if self._client is not None:
                self._down.push(now, (datagram, self._client))
        for datagram, sender in self._up.pop(now):
            is_for_all = is_broadcast(datagram)
            if not is_for_all and datagram[:1] != _NULL:
                self._client = sender
            # As on a radio, answers to a broadcast go to the client.
            receiver = self._client if is_for_all else sender
            for answer in self.vehicle.receive(datagram):
                if receiver is not None:
                    self._down.push(now, (answer, receiver))
        for datagram, receiver in self._down.pop(now):
            send(self._socket, datagram, receiver)
        # The vehicle moves in steps: it may not have moved since the last observation.
        is_new = self.vehicle.time > self._observed
        if self._observer[1] and now >= self._next_observation and is_new:
            self._observed = self.vehicle.time
            missed = (now - self._next_observation) // self._observation_period
            self._next_observation += (1 + missed) * self._observation_period
            send(self._socket, self.observe().encode(), self._observer)


def virtual_crazyflie() -> None:
    """Run a virtual vehicle until interrupted."""
    run_server(
        "virtual_crazyflie",
        "A Crazyflie in software that speaks CRTP over UDP: connect with any cflib program to "
        "udp://HOST:PORT.",
        VehicleSettings,
        VehicleServer,
        "crazyflie_virtual.nodes:VirtualCrazyflieNode",
    )


def _number(port):
    # 1, 2, ... for the ports that clients scan; nearly always different for different ports.
    number = port - FIRST_PORT + 1 if port >= FIRST_PORT else port
    return number & 0x7FFF or 1
