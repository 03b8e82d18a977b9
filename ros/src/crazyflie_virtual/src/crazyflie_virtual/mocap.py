"""The virtual motion capture system: its settings, its observations, and its NatNet server."""

import math
import random
import select
import socket
import time
from collections import deque
from collections.abc import Callable

from typing_extensions import override

from crazyflie_model.angles import Quaternion, Triple, turned
from crazyflie_simulator.vehicle import MotionCapture
from crazyflie_utils.parameters.declaration import Parameters, parameter
from crazyflie_utils.parameters.types import BOOLEAN, PORT, SHARE, TEXT, Integer, Number, Text
from crazyflie_virtual import natnet
from crazyflie_virtual.natnet import VERSIONS, Encoder, StreamedBody
from crazyflie_virtual.server import (
    Address,
    Observation,
    Server,
    open_socket,
    received,
    run_server,
    send,
)
from crazyflie_virtual.settings import OBSERVER_PORT, UDP_PORT, switches

OCCLUSION = 0.3  #: Longest time for which a vehicle is hidden, s.
_LARGEST = 3.4e38  #: Largest number of the stream.
_GHOST_MARGIN = 0.3  #: Largest distance of reflections from the vehicles, along each axis (m).
_STALE = 0.5  #: Age of the last observation above which a body is not tracked (s).


def is_listed(body_id: int, text: str) -> bool:
    """Return whether a text names a body: numbers with commas, or "all"."""
    names = [part.strip() for part in text.split(",")]
    return "all" in names or str(body_id) in names


class MocapSettings(Parameters):
    """Settings of the NatNet server; the live ones are its faults, see `settings.switches`."""

    host: str = parameter(
        TEXT,
        "address on which the server listens, and address of the interface for multicast",
        "127.0.0.1",
    )
    command_port: int = parameter(UDP_PORT, "UDP port for commands; 0 selects a free one", 1510)
    data_port: int = parameter(PORT, "UDP port of the multicast stream", 1511)
    multicast: bool = parameter(
        BOOLEAN, "stream to the group, not to each client that sends keep-alives", False
    )
    multicast_address: str = parameter(TEXT, "the group, an IPv4 address", "239.255.42.99")
    version: str = parameter(
        Text(VERSIONS), "NatNet version of the stream (quote it in YAML)", "3.1"
    )
    rate: float = parameter(Number("Hz", minimum=1.0, maximum=1000.0), "rate of frames", 120.0)
    observer_port: int = parameter(
        UDP_PORT,
        "UDP port at which the vehicles' true poses arrive; 0 selects a free one",
        OBSERVER_PORT,
        "observer/port",
    )
    position_noise: float = parameter(
        Number("m", minimum=0.0), "standard deviation along each axis", 0.0, "noise/position"
    )
    attitude_noise: float = parameter(
        Number("rad", minimum=0.0),
        "standard deviation about each axis of the body",
        0.0,
        "noise/attitude",
    )
    latency: float = parameter(
        Number("s", minimum=0.0, maximum=1.0), "time from exposure to dispatch", 0.0
    )
    seed: int = parameter(Integer(0, 2**31 - 1), "seed of the noise", 0)
    dropout: float = parameter(
        SHARE,
        "probability with which a body is not tracked in a frame",
        0.0,
        "fault/dropout",
        live=True,
    )
    invalid: str = parameter(
        Text(may_be_empty=True),
        "bodies that are not tracked: numbers with commas, or all",
        "",
        "fault/invalid",
        live=True,
    )
    silent: bool = parameter(BOOLEAN, "send no frames", False, "fault/silent", live=True)
    ghosts: float = parameter(
        Number(minimum=0.0, maximum=100.0),
        "mean number of reflections in a frame, which belong to no vehicle",
        0.0,
        "fault/ghosts",
        live=True,
    )
    occlusions: float = parameter(
        Number("1/s", minimum=0.0, maximum=100.0),
        f"rate at which each vehicle is hidden, for up to {OCCLUSION:g} s",
        0.0,
        "fault/occlusions",
        live=True,
    )
    single_markers: str = parameter(
        Text(may_be_empty=True),
        "vehicles that have one marker and are not rigid bodies: numbers with commas, or all",
        "",
    )


class MocapScene:
    """Rigid bodies at their last observation.

    Vehicles with one marker are not rigid bodies.
    """

    def __init__(self, settings: MocapSettings):
        self.switches = switches(settings)  #: Faults, which may be changed.
        self._settings = settings
        self._random = random.Random(settings.seed)
        self._observations: dict[int, Observation] = {}
        self._cameras: dict[int, MotionCapture] = {}
        self._seen: dict[int, tuple[Triple, Quaternion]] = {}
        self._hidden_until: dict[int, float] = {}

    def observe(self, observation: Observation) -> None:
        """Process an `Observation`."""
        body_id = observation.body_id
        if body_id not in self._cameras:
            s = self._settings
            self._cameras[body_id] = MotionCapture(
                s.position_noise, s.attitude_noise, seed=(s.seed, body_id)
            )
        self._observations[body_id] = observation

    def bodies(self, time: float) -> list[StreamedBody]:
        """Return every rigid body at ``time`` (s), in the order of their numbers.

        A body that is not tracked has its last tracked pose.
        """
        return self._see_all(time, has_single_marker=False)

    def markers(self, time: float) -> list[Triple]:
        """Return the markers of vehicles that have one, and reflections, in any order, m.

        Markers that are not seen are missing.
        """
        found = self._see_all(time, has_single_marker=True)
        points = [body.position for body in found if body.is_tracked]
        if found and self.switches.ghosts:
            ranges = [
                (min(axis) - _GHOST_MARGIN, max(axis) + _GHOST_MARGIN)
                for axis in zip(*(body.position for body in found), strict=True)
            ]
            ghosts = int(self.switches.ghosts + self._random.random())
            points += [
                tuple(self._random.uniform(*limits) for limits in ranges) for _ in range(ghosts)
            ]
        self._random.shuffle(points)
        return points

    def _see_all(self, time, has_single_marker):
        return [
            self._see(self._observations[number], time)
            for number in sorted(self._observations)
            if is_listed(number, self._settings.single_markers) == has_single_marker
        ]

    def _is_hidden(self, body_id, time):
        rate = self.switches.occlusions
        if time < self._hidden_until.get(body_id, 0.0):
            return True
        if not rate or self._random.random() >= rate / self._settings.rate:
            return False
        self._hidden_until[body_id] = time + self._random.uniform(0.0, OCCLUSION)
        return True

    def _see(self, observation, time):
        body_id, name = observation.body_id, observation.name
        lost = (
            time - observation.time > _STALE
            or is_listed(body_id, self.switches.invalid)
            or self._random.random() < self.switches.dropout
            or self._is_hidden(body_id, time)
        )
        if not lost:
            camera = self._cameras[body_id]
            camera.measure(time, *_extrapolate(observation, time))
            _, position, quaternion = camera.arrivals(time)[-1]
            self._seen[body_id] = tuple(map(_streamed, position)), tuple(map(_streamed, quaternion))
        never = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        position, quaternion = self._seen.get(body_id, never)
        return StreamedBody(body_id, name, position, quaternion, not lost)


def _streamed(number):
    # The stream's floats have 32 bits: struct refuses what is too large for them.
    return number if abs(number) <= _LARGEST else math.nan


def _extrapolate(observation, time):
    # Observations come with a few milliseconds between them and not in step
    # with the frames; between them the vehicle is extrapolated on a straight line.
    dt = time - observation.time
    position = tuple(
        p + v * dt for p, v in zip(observation.position, observation.velocity, strict=True)
    )
    try:
        attitude = turned(observation.quaternion, [dt * rate for rate in observation.rates])
    except ValueError:
        # Sine and cosine refuse infinite angles.
        attitude = (math.nan,) * 4
    return position, attitude


_CLIENT_LIMIT = 5.0  #: Age of a client's last message above which it receives no frames (s).
_LONGEST_WAIT = 0.1  #: s.


class MocapServer(Server):
    """Streams the frames of a `MocapScene`; OSError if a port is taken or an address is invalid.

    ``warn`` is not used: the server does not fall behind.
    """

    def __init__(self, settings: MocapSettings, warn: Callable[[str], None] | None = None):
        self._settings = settings
        _check_address("multicast_address", settings.multicast_address)
        self._scene = MocapScene(settings)
        self.switches = self._scene.switches
        self._encoder = Encoder(settings.version)
        self._commands = open_socket(settings.host, settings.command_port)
        try:
            self._observations = open_socket("127.0.0.1", settings.observer_port)
        except OSError:
            self._commands.close()
            raise
        self.address = self._commands.getsockname()  #: Host and port for commands.
        way = "unicast"
        if settings.multicast:
            way = f"multicast to {settings.multicast_address}:{settings.data_port}"
        host, port = self.address
        text = f"virtual motion capture: NatNet {settings.version} at {host}:{port}, {way}"
        super().__init__(text, self._commands, self._observations)
        #: Address at which the true poses of the vehicles arrive.
        self.observer_port = self._observations.getsockname()[1]
        if settings.multicast:
            interface = socket.inet_aton(settings.host)
            self._commands.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, interface)
        self._clients: dict[Address, float] = {}
        self._period = 1.0 / settings.rate
        self._begin = time.monotonic()
        self._frames = 0
        self._pending: deque[tuple[float, float, int, list[StreamedBody], list[Triple]]] = deque()

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
            observation = Observation.decode(datagram)
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
        # Missed frames are not sent later, like those of a busy system.
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


def virtual_mocap() -> None:
    """Run a virtual motion capture system until interrupted."""
    run_server(
        "virtual_mocap",
        "A motion capture system in software: streams the true poses of the virtual vehicles on "
        "this machine as a NatNet server.",
        MocapSettings,
        MocapServer,
        "crazyflie_virtual.nodes:VirtualMocapNode",
    )


if __name__ == "__main__":
    virtual_mocap()
