"""Vehicles for tests, in the process of the test: a virtual one, and one that the test controls.

`FakeVehicle` is for tests of clients. Commands and setpoints are the virtual firmware's, see
`FakeFlight`; log variables, parameters and replies are the test's. It connects in 0.02 s where a
`virtual_vehicle` with all its tables takes 0.2 s, and takes a tenth of the processor time.
"""

import contextlib
import math
import struct
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from crazyflie_model.supervisor import SupervisorState
from crazyflie_virtual.body import Physics
from crazyflie_virtual.crtp import Packet, Port, decode, is_broadcast
from crazyflie_virtual.firmware.firmware import SUPERVISOR_PROTOCOL, Firmware
from crazyflie_virtual.firmware.planner import ACTIVE, TrajectoryState
from crazyflie_virtual.firmware.setpoints import PRIORITY_CRTP
from crazyflie_virtual.firmware.states import DISABLED
from crazyflie_virtual.firmware.supervisor import LANDED_AFTER, State
from crazyflie_virtual.log import LogPort, LogVariable
from crazyflie_virtual.memory import TRAJECTORY, Memory, MemoryPort
from crazyflie_virtual.ports import HANDLERS
from crazyflie_virtual.server import Server, VehicleServer, open_socket
from crazyflie_virtual.settings import VehicleSettings, switches
from crazyflie_virtual.toc import LOG_TYPES, PARAMETER_TYPES, Table


@contextlib.contextmanager
def virtual_vehicle(**settings: Any) -> Iterator[tuple[VehicleServer, str]]:
    """Run a vehicle with `VehicleSettings`, by default on a free port; yield server and address."""
    server = VehicleServer(VehicleSettings(**{"port": 0, "observer_port": 0, **settings}))
    server.start()
    try:
        yield server, "udp://{}:{}".format(*server.address)
    finally:
        server.stop()


READ_ONLY, EXTENDED = 0x40, 0x10

_OTHER_MEMORY = 0x18  #: Type of the memory that precedes that of trajectories.

_TYPES = {each.format: each for each in (*LOG_TYPES.values(), *PARAMETER_TYPES.values())}

_EMERGENCY_STOP = 0x03
_RESET_LOGS = (Port.LOG, 1, b"\x05")
_NULL_PACKET = (15, 3)  #: Port and channel of the packet by which vehicles are searched.

#: Ports and channels on which the firmware answers. Others are those of the fake vehicle.
_FIRMWARE_CHANNELS = {
    *((Port.SETPOINT, 0), (Port.GENERIC_SETPOINT, 0), (Port.GENERIC_SETPOINT, 1)),
    *((Port.HIGH_LEVEL, 0), (Port.PLATFORM, 1), (Port.LINK, 0), (Port.LINK, 1)),
}

_THAW = bytes(40)  #: A datagram that ends a freeze; packets are shorter.
_THAW_LIMIT = 60.0  #: Longest time until a vehicle thaws on a busy machine (s).


class FakeFlight(Firmware):
    """The firmware's commander, planner and protocol of a vehicle without dynamics.

    Setpoints and commands alone decide whether the motors run, by a clock (s); the supervisor's
    watchdogs are left out: silence changes nothing. ``starts`` is how many times the motors have
    begun to run.
    """

    def __init__(self, protocol: int = 12, clock: Callable[[], float] = time.monotonic):
        settings: dict[str, Any] = {"protocol": protocol, "sensor_noise": False}
        self._settings = VehicleSettings(**settings)
        self._clock = clock
        #: Held by whoever uses it: tests restart it while the vehicle's thread answers.
        self.in_use = threading.RLock()
        #: Time by which the clock of log data, which is real, is ahead of this machine's (ms).
        self.clock_ahead_ms = 0
        self.restart()

    def restart(self) -> None:
        """Begin as after a restart of the vehicle: on the ground, armed."""
        with self.in_use:
            physics = Physics((0.0, 0.0, 0.0), 0.0)
            super().__init__(physics, switches(self._settings), self._settings)
            self.starts = 0
            self._pinned: SupervisorState | None = None
            self._motors_ran = False
            self._stop_time = -math.inf

    def pin(self, state: SupervisorState | int | None) -> None:
        """Report a state whatever happens, with a planner that fits to it; None for no longer."""
        self._pinned = None if state is None else SupervisorState(state)
        if self._pinned is not None:
            is_active = SupervisorState.HIGH_LEVEL_ACTIVE in self._pinned
            self.planner.state = TrajectoryState.FLYING if is_active else TrajectoryState.IDLE

    @property
    def milliseconds(self) -> int:
        """Time of log data, ms."""
        return int(time.monotonic() * 1000.0) + self.clock_ahead_ms

    @property
    def motors_run(self) -> bool:
        """Whether the motors run."""
        self.update()
        return self._motors_ran

    @property
    def is_landing(self) -> bool:
        """Whether the planner lands."""
        self.update()
        return self.planner.state is TrajectoryState.LANDING

    @property
    def state(self) -> SupervisorState:
        """The state as clients see it."""
        self.update()
        return self.client_state() if self._pinned is None else self._pinned

    def lock(self) -> None:
        """Stop the motors and lock, until `restart`."""
        self.supervisor.state, self.supervisor.is_armed = State.LOCKED, False
        self.planner.block(True)
        self.update()

    def update(self) -> None:
        """Advance to the present time; called before and after each command."""
        with self.in_use:
            self._advance()

    def _advance(self):
        now = self.time = self._clock()
        planner, setpoint = self.planner, self.commander.setpoint
        has_landed = planner.state is TrajectoryState.LANDING and planner.is_finished(now)
        if has_landed:
            planner.stop()
        runs = planner.state in ACTIVE
        if self.commander.priority == PRIORITY_CRTP:
            runs = setpoint.thrust > 0.0 or setpoint.mode.z != DISABLED
        runs = runs and self.supervisor.state is not State.LOCKED
        if runs and not self._motors_ran:
            self.starts += 1
        if self._motors_ran and not runs:
            self._stop_time = planner.end if has_landed else now
        self._motors_ran = runs
        if self.supervisor.state is not State.LOCKED:
            is_flying = runs or now - self._stop_time < LANDED_AFTER
            self.supervisor.state = State.FLYING if is_flying else State.READY_TO_FLY


class FakeVehicle(Server, contextlib.AbstractContextManager["FakeVehicle"]):
    """A vehicle on a UDP port of this machine, by default any free one.

    Log variables are "group.name" -> (struct format of the type, value), parameters "group.name" ->
    (struct format of the type, value, flags); ``clock()`` returns the time of the flight, s.
    """

    def __init__(
        self,
        log: dict[str, tuple[str, float]] | None = None,
        parameters: dict[str, tuple[str, float, int]] | None = None,
        protocol: int = 12,
        port: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ):
        #: Answers commands and reports the supervisor's state, also as the log variable
        #: supervisor.info if ``log`` has it.
        self.flight = FakeFlight(protocol, clock)
        self.log = log if log is not None else {"pm.vbat": ("f", 3.9)}
        self.parameters = parameters if parameters is not None else {"ring.effect": ("B", 1, 0)}
        self.received: list[tuple[int, int, bytes]] = []  #: All packets, oldest first.
        self.broadcasts: list[tuple[int, int, bytes]] = []  #: Those that came as a broadcast.
        self.hears_broadcasts = True  #: Whether broadcasts arrive.
        #: Packets that begin like this get no answer.
        self.deaf: set[tuple[int, int, bytes]] = set()
        #: (port, channel, first byte) -> data to answer with, in the place of its own.
        self.answers: dict[tuple[int, int, int | None], bytes] = {}
        #: ``lose(count)`` returns whether the reply with this number is lost.
        self.lose: Callable[[int], bool] = lambda count: False
        #: A packet that begins like this stops the vehicle, before it is read, until `resume`.
        self.stalls_at: tuple[int, int, bytes] | None = None
        self._resumed = threading.Event()
        self._is_frozen = False
        self._thawed = threading.Event()
        self._changed = threading.Condition()
        self._replies = 0
        self.forget_logs()
        self._peer: tuple[str, int] | None = None
        self._socket = open_socket("127.0.0.1", port)
        self._socket.settimeout(0.01)
        self.port = self._socket.getsockname()[1]
        super().__init__(self.uri, self._socket)
        self.start()

    @property
    def is_frozen(self) -> bool:
        """Whether it neither receives nor sends anything; what is sent to it meanwhile is lost."""
        return self._is_frozen

    @is_frozen.setter
    def is_frozen(self, frozen: bool) -> None:
        if frozen or not self._is_frozen:
            self._is_frozen = frozen
            return
        # Behind what may still wait in the socket: on a busy machine the thread may be late.
        self._thawed.clear()
        self._socket.sendto(_THAW, self._socket.getsockname())
        assert self._thawed.wait(_THAW_LIMIT), "the thread of the vehicle hangs"

    def resume(self) -> None:
        """Resume a vehicle that has stopped at `stalls_at`; it reads what has come meanwhile."""
        self.stalls_at = None
        self._resumed.set()

    @property
    def uri(self) -> str:
        """Address of the vehicle."""
        return f"udp://127.0.0.1:{self.port}"

    def __exit__(self, *_: object) -> None:
        """Close the port."""
        self.close()

    def close(self) -> None:
        """Close the port: the vehicle is gone."""
        self.resume()
        self.stop()

    def send(self, port: int, channel: int, data: bytes) -> None:
        """Send a packet without being asked."""
        self.send_datagram(Packet(port, channel, data).encode())

    def send_datagram(self, datagram: bytes) -> None:
        """Send any datagram."""
        if self._peer is not None and not self._is_frozen:
            self._socket.sendto(datagram, self._peer)

    def packets(self, port: int, channel: int) -> list[bytes]:
        """Return the data of all packets received on a port and channel, oldest first."""
        return [data for p, c, data in list(self.received) if (p, c) == (port, channel)]

    def wait_for(self, condition: Callable[[], bool], limit: float = 60.0) -> bool:
        """Wait until ``condition()`` holds, checked after every packet; return whether it does."""
        with self._changed:
            return self._changed.wait_for(condition, limit)

    def wait_for_packets(
        self, port: int, channel: int, count: int = 1, limit: float = 60.0
    ) -> list[bytes]:
        """Return all packets on a port and channel once there are so many within a limit (s)."""
        self.wait_for(lambda: len(self.packets(port, channel)) >= count, limit)
        found = self.packets(port, channel)
        assert len(found) >= count, f"{len(found)} of {count} packets on {port}/{channel}"
        return found

    def serve(self) -> None:
        """Send the log data that are due; process one datagram if one comes within 0.01 s."""
        for each in self._logs.collect():
            self.send(*each)
        try:
            datagram, peer = self._socket.recvfrom(64)
        except OSError:
            # Nothing has come, or nothing listens to what was sent.
            return
        if datagram == _THAW:
            self._is_frozen = False
            self._thawed.set()
            return
        packet = decode(datagram)
        if self._is_frozen or packet is None:
            return
        if self.stalls_at is not None and _begins(packet, self.stalls_at):
            self._resumed.wait(_THAW_LIMIT)
        is_for_all = is_broadcast(datagram)
        if is_for_all and not self.hears_broadcasts:
            return
        if not is_for_all:
            self._peer = peer
        with self._changed:
            self.received.append(packet)
            if is_for_all:
                self.broadcasts.append(packet)
            self._changed.notify_all()
        if not any(_begins(packet, each) for each in self.deaf):
            self._reply(*packet)

    def _reply(self, port, channel, data):
        if (port, channel) == _NULL_PACKET:
            self.send(*_NULL_PACKET, b"")
            return
        answer = self.answers.get((port, channel, data[0] if data else None))
        if answer is None:
            with self.flight.in_use:
                self.flight.update()
                answer = self._answer(port, channel, data)
                self.flight.update()
        if answer is None:
            return
        self._replies += 1
        if not self.lose(self._replies):
            self.send(port, channel, answer)

    def _answer(self, port, channel, data):
        if (port, channel) in _FIRMWARE_CHANNELS:
            return HANDLERS[port](self.flight, channel, data)
        if port == Port.LOG:
            if (port, channel, data[:1]) == _RESET_LOGS:
                self.forget_logs()
            return self._logs.handle(channel, data)
        if port == Port.MEMORY:
            return self._memory(channel, data)
        method = getattr(self, f"_on_{port}_{channel}", None)
        return None if method is None else method(data)

    def forget_logs(self) -> None:
        """Send no log data any more, as after a restart between two pings."""
        variables = [
            LogVariable(group, variable, _TYPES[form], partial(self._value, name))
            for name, (form, _) in self.log.items()
            for group, variable in [name.split(".")]
        ]
        self._logs = LogPort(self.flight, variables)

    def _value(self, name, flight):
        return int(flight.state) if name == "supervisor.info" else self.log[name][1]

    def _memory(self, channel, data):
        # The first one is never read.
        memories = (Memory(_OTHER_MEMORY, b""), Memory(TRAJECTORY, self.flight.planner.memory))
        return MemoryPort(memories, self.flight.warn).handle(channel, data)

    # Parameters.

    def _on_2_0(self, data):
        entries = [
            (group, parameter, _TYPES[form].parameter_code | flags)
            for name, (form, _, flags) in self.parameters.items()
            for group, parameter in [name.split(".")]
        ]
        return Table(entries).answer(data)

    def _on_2_1(self, data):
        code, value, _ = list(self.parameters.values())[struct.unpack("<H", data)[0]]
        return data + b"\0" + struct.pack("<" + code, value)

    def _on_2_2(self, data):
        name = list(self.parameters)[struct.unpack_from("<H", data)[0]]
        code, _, flags = self.parameters[name]
        self.parameters[name] = (code, struct.unpack("<" + code, data[2:])[0], flags)
        return data

    def _on_2_3(self, data):
        return data[:3] + b"\0\x01"

    # Supervisor.

    def _on_9_0(self, data):
        if self.flight.protocol < SUPERVISOR_PROTOCOL:
            return None
        return bytes([0x80 | data[0]]) + struct.pack("<H", self.flight.state)

    def _on_9_1(self, data):
        if data[0] == _EMERGENCY_STOP:
            self.flight.lock()
        return bytes([0x80 | data[0], 1, data[1] if len(data) > 1 else 1])


def _begins(received, beginning):
    return received[:2] == beginning[:2] and received[2].startswith(beginning[2])
