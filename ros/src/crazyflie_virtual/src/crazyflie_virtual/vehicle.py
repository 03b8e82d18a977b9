"""A virtual Crazyflie without sockets and clock: body, battery, radio chip and microcontroller."""

import logging
import math
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace

from crazyflie_utils.parameters import vehicle_model
from crazyflie_virtual import crtp, memory, ports
from crazyflie_virtual.body import LOW_CHARGE, OFF, STEP, Battery, Physics
from crazyflie_virtual.crtp import FirmwareAssertionError, Packet, Port
from crazyflie_virtual.firmware.decks import lighthouse_pages
from crazyflie_virtual.firmware.firmware import SUPERVISOR_PROTOCOL, Firmware
from crazyflie_virtual.firmware_parameters import ParameterPort
from crazyflie_virtual.log import LogPort, log_variables
from crazyflie_virtual.memory import LighthouseMemory, Memory, MemoryPort
from crazyflie_virtual.settings import VehicleSettings, switches
from crazyflie_world import world_file

_ADDRESS_PREFIX = 0xE7E7E7E700


class Storage:
    """Memories and stored parameters, which persist over a restart."""

    def __init__(self, settings: VehicleSettings):
        self.eeprom = memory.eeprom(_ADDRESS_PREFIX | settings.address)
        self.one_wire = memory.one_wire(settings)
        self.lighthouse = lighthouse_pages(settings)
        self.parameters: dict[str, float] = {}


class Board:
    """A running firmware behind its ports; for ``failure`` see `Firmware`."""

    def __init__(
        self,
        physics: Physics,
        faults: SimpleNamespace,
        settings: VehicleSettings,
        storage: Storage,
        failure: str = "",
    ):
        firmware = self.firmware = Firmware(physics, faults, settings, failure)
        self._log = LogPort(firmware, log_variables())
        stations = max(LighthouseMemory.STATIONS, settings.base_stations)
        lighthouse = LighthouseMemory(storage.lighthouse, stations)
        firmware.deck.memory = lighthouse
        memories = [
            storage.eeprom,
            Memory(memory.TRAJECTORY, firmware.planner.memory),
            firmware.memory_tester,
            Memory(memory.LED_RING, bytearray(memory.LED_RING_SIZE)),
            Memory(memory.LED_TIMINGS, bytearray(memory.LED_TIMINGS_SIZE)),
            lighthouse,
            memory.decks_firmware(),
            *storage.one_wire,
        ]
        self._handlers: dict[int, Callable[[int, bytes], bytes | None]] = {
            **{port: partial(handler, firmware) for port, handler in ports.HANDLERS.items()},
            Port.LOG: self._log.handle,
            Port.PARAMETERS: ParameterPort(firmware, storage.parameters).handle,
            Port.MEMORY: MemoryPort(memories, firmware.warn).handle,
        }
        if settings.protocol < SUPERVISOR_PROTOCOL:
            del self._handlers[Port.SUPERVISOR]

    def receive(self, packet: Packet, is_broadcast: bool = False) -> Packet | None:
        """Return the answer to a packet, from the same port and channel; None for no answer."""
        statistics = self.firmware.link_statistics
        statistics.count_received(self.firmware.time, is_broadcast)
        if packet.port not in self._handlers:
            self.firmware.warn("port", f"CRTP: nothing listens on port {packet.port}")
            return None
        answer = self._handlers[packet.port](packet.channel, packet.data)
        if answer is None:
            return None
        statistics.count_sent(1)
        return packet._replace(data=answer)

    def unsolicited(self) -> list[Packet]:
        """Return the packets that answer no request: log data and console."""
        firmware = self.firmware
        packets = self._log.collect()
        angles = firmware.deck.take_angles()
        packets += [Packet(Port.LOCALIZATION, ports.GENERIC, each) for each in angles]
        if firmware.link_statistics.is_connected:
            packets += [Packet(Port.CONSOLE, 0, piece) for piece in firmware.console.take()]
        firmware.link_statistics.count_sent(len(packets))
        return packets


#: Channel of the link port that the radio chip answers, also while the microcontroller is off.
_RADIO_CHANNEL = 3

#: Commands to the radio chip: all off, microcontroller off and on, and reset, which has a mode.
_ALL_OFF, _OFF, _ON, _RESET = b"\xfe\x01", b"\xfe\x02", b"\xfe\x03", b"\xfe\xf0"
_TO_FIRMWARE = _RESET + b"\x01"  #: There is no boot loader to reset to.

_BATTERY_STEPS = 10

_RESTART_TIME = 1.0  #: Time of a restart after a failed assertion, s: assumed.

_LOGGER = logging.getLogger(__name__)


class VirtualVehicle:
    """Body, battery, radio chip and microcontroller.

    `ParameterError`: the world file is missing or wrong.
    """

    def __init__(self, settings: VehicleSettings):
        self._settings = settings
        self.faults = switches(settings)
        #: The true state.
        self.physics = Physics(
            (settings.init_x, settings.init_y, 0.0),
            settings.init_yaw,
            settings.mass_error,
            settings.thrust_error,
            vehicle_model.load(settings.model),
            settings.ground_effect,
        )
        if settings.world:
            self.physics.world = world_file.load(settings.world)
        self.battery = Battery(settings.battery)
        self.storage = Storage(settings)  #: Data that persist over a restart.
        self._steps = 0
        self._is_dead = False
        self._failure = ""
        self._restart_time = math.inf
        self.board: Board | None = None  #: None while the microcontroller is off.
        self._turn_on()

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self._steps * STEP

    def receive(self, datagram: bytes) -> list[bytes]:
        """Return the datagrams that answer one."""
        packet = crtp.decode(datagram)
        if packet is None or self._is_dead:
            return []
        if packet.port == Port.LINK and packet.channel == _RADIO_CHANNEL:
            self._command_radio(packet.data)
            # Clients that scan, or switch the power, expect any packet.
            return [Packet(Port.LINK, _RADIO_CHANNEL, b"").encode()]
        if self.board is None:
            return []
        try:
            answer = self.board.receive(packet, crtp.is_broadcast(datagram))
            return [] if answer is None else [answer.encode()]
        except FirmwareAssertionError as assertion:
            self._restart(str(assertion))
            return []
        except Exception as error:
            text = f"{type(error).__name__} in packet {datagram.hex()}: {error}"
            if self.board.firmware.warn("error", f"SYS: {text}"):
                _LOGGER.exception("virtual vehicle: %s", text)
            return []

    def advance_to(self, time: float) -> list[bytes]:
        """Advance to the last whole step before ``time`` (s); return unasked datagrams."""
        datagrams = []
        for _ in range(math.floor(time / STEP + 1e-6) - self._steps):
            datagrams += self._step()
        return datagrams

    def _step(self):
        self._steps += 1
        commands, datagrams = OFF, []
        if self.time >= self._restart_time:
            self._start(self._failure)
        if self.board is not None:
            try:
                commands = self.board.firmware.step(self.battery.voltage)
                self.physics.desired = self.board.firmware.stabilizer.desired
                datagrams = [packet.encode() for packet in self.board.unsolicited()]
            except Exception as error:
                failure = f"{type(error).__name__} in a step: {error}"
                _LOGGER.exception("virtual vehicle: %s; it restarts", failure)
                # It would fail in the next step, too.
                self._restart(failure)
        if math.isnan(sum(commands)):
            # The processor converts NaN to zero.
            commands = OFF
        failed = self.faults.motor_failure
        if failed:
            commands = commands._replace(**{f"m{failed}": 0.0})
        self.physics.step(commands, self.battery.voltage)
        if self.faults.low_battery:
            self.battery.charge = min(self.battery.charge, LOW_CHARGE)
        if self._steps % _BATTERY_STEPS == 0:
            self.battery.step(_BATTERY_STEPS * STEP, self.physics.load)
        return datagrams

    def _restart(self, failure):
        self.board = None
        self._failure = failure
        self._restart_time = self.time + _RESTART_TIME

    def _command_radio(self, data):
        command = data[:2]
        if command in (_ALL_OFF, _OFF, _RESET):
            self.board = None
        if command in (_ALL_OFF, _OFF):
            # A reset does not end a restart that has begun.
            self._restart_time = math.inf
            self._is_dead = command == _ALL_OFF
        if data.startswith(_TO_FIRMWARE) or (command == _ON and self.board is None):
            self._turn_on()

    def _turn_on(self):
        self.physics.put_upright()
        self._start()

    def _start(self, failure=""):
        self._restart_time = math.inf
        self.board = Board(self.physics, self.faults, self._settings, self.storage, failure)
