"""The virtual vehicle on a UDP port, in real time."""

import math
import random
import select
import time
from collections.abc import Callable

from typing_extensions import override

from crazyflie_virtual.link.channel import Channel
from crazyflie_virtual.link.crtp import is_broadcast
from crazyflie_virtual.observer import Observation
from crazyflie_virtual.server import Address, Server, open_socket, received, send
from crazyflie_virtual.settings import FIRST_PORT, VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle

_TICK = 0.005  #: How long the vehicle may be behind the clock when nothing happens, s.
#: What is simulated at once, s; beyond that the vehicle loses time instead of its link.
_GREATEST_LAG = 0.25
_NULL = b"\xff"  #: What a scanner sends: it is no client.


class VehicleServer(Server):
    """A vehicle behind a socket; OSError if the port is taken.

    ``warn(text)`` is called when the vehicle cannot keep up with the clock.
    """

    def __init__(self, settings: VehicleSettings, warn: Callable[[str], None] = lambda text: None):
        self._socket = open_socket(settings.host, settings.port)
        super().__init__(self._socket)
        self.address = self._socket.getsockname()  #: Host and port.
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

    @property
    @override
    def description(self) -> str:
        host, port = self.address
        return f"virtual Crazyflie at udp://{host}:{port}"

    @override
    def serve(self) -> None:
        datagrams = list(received(self._socket))
        # What has been received was sent before now.
        now = time.monotonic()
        self._process(now, datagrams)
        arrival = min(self._up.next_arrival(), self._down.next_arrival())
        wake = min(now - (now - self._begin) % _TICK + _TICK, arrival)
        select.select([self._socket], [], [], max(0.0, wake - time.monotonic()))

    def observe(self) -> Observation:
        """Return the truth about the vehicle, as of now."""
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
        self.vehicle.faults.pass_time(now - self._last_time)
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
            receiver: Address | None = sender
            if is_broadcast(datagram):
                # As on a radio, what answers it goes to the client.
                receiver = self._client
            elif datagram[:1] != _NULL:
                self._client = sender
            for answer in self.vehicle.receive(datagram):
                if receiver is not None:
                    self._down.push(now, (answer, receiver))
        for datagram, receiver in self._down.pop(now):
            send(self._socket, datagram, receiver)
        # The vehicle moves in steps: it may be where it was at the last observation.
        is_new = self.vehicle.time > self._observed
        if self._observer[1] and now >= self._next_observation and is_new:
            self._observed = self.vehicle.time
            missed = (now - self._next_observation) // self._observation_period
            self._next_observation += (1 + missed) * self._observation_period
            send(self._socket, self.observe().encode(), self._observer)


def _number(port):
    # 1, 2, ... for the ports that clients scan; in any case different for
    # different ports, nearly.
    number = port - FIRST_PORT + 1 if port >= FIRST_PORT else port
    return number & 0x7FFF or 1
