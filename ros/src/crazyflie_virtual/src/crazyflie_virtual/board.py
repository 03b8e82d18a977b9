"""The microcontroller: firmware and ports, from power-up on."""

from collections.abc import Callable
from typing import Any

from crazyflie_virtual.body.physics import MotorCommands, Physics
from crazyflie_virtual.faults import FaultSwitches
from crazyflie_virtual.firmware.firmware import SUPERVISOR_PROTOCOL, Firmware
from crazyflie_virtual.firmware.localization import DECK
from crazyflie_virtual.link.crtp import Packet, Port
from crazyflie_virtual.ports.high_level import HighLevelPort
from crazyflie_virtual.ports.link import LinkPort
from crazyflie_virtual.ports.localization import LocalizationPort
from crazyflie_virtual.ports.log import LogPort
from crazyflie_virtual.ports.memory import MemoryPort
from crazyflie_virtual.ports.parameters import ParameterPort
from crazyflie_virtual.ports.platform import PlatformPort
from crazyflie_virtual.ports.setpoints import AttitudeSetpointPort, GenericSetpointPort
from crazyflie_virtual.ports.supervisor import SupervisorPort
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.tables.decks import decks
from crazyflie_virtual.tables.memories import LighthouseMemory, eeprom, memories

_ADDRESS_PREFIX = 0xE7E7E7E700


class Storage:
    """Memories and stored parameters, which persist over a restart.

    Parameters
    ----------
    settings : VehicleSettings
    """

    def __init__(self, settings: VehicleSettings):
        self.eeprom = eeprom(_ADDRESS_PREFIX | settings.address)
        self.one_wire = [
            (deck.serial, deck.one_wire())
            for deck in decks(settings.positioning == DECK, settings.multiranger)
        ]
        self.lighthouse: dict[int, bytes] = {}
        self.parameters: dict[str, float] = {}


class Board:
    """A running firmware behind its ports.

    Parameters
    ----------
    physics : Physics
    faults : FaultSwitches
    settings : VehicleSettings
    storage : Storage
    failure : str
        See `Firmware`.
    """

    def __init__(
        self,
        physics: Physics,
        faults: FaultSwitches,
        settings: VehicleSettings,
        storage: Storage,
        failure: str = "",
    ):
        firmware = self.firmware = Firmware(physics, faults, settings, failure)
        supervisor = SupervisorPort(firmware)
        self._log = LogPort(firmware)
        lighthouse = LighthouseMemory(storage.lighthouse)
        ports: list[Any] = [
            LinkPort(firmware.warn),
            PlatformPort(settings.protocol, supervisor, firmware.warn),
            self._log,
            ParameterPort(firmware, storage.parameters),
            MemoryPort(
                memories(
                    storage.eeprom,
                    firmware.planner.memory,
                    firmware.memory_tester,
                    lighthouse,
                    storage.one_wire,
                ),
                firmware.warn,
            ),
            AttitudeSetpointPort(firmware),
            GenericSetpointPort(firmware),
            HighLevelPort(firmware),
            LocalizationPort(firmware, settings.address, lighthouse),
        ]
        if settings.protocol >= SUPERVISOR_PROTOCOL:
            ports.append(supervisor)
        self._handlers: dict[int, Callable[[Packet], list[Packet]]] = {
            port.port: port.handle for port in ports
        }

    def receive(self, packet: Packet) -> list[Packet]:
        """Return the answers to a packet."""
        self.firmware.link_statistics.count_received(self.firmware.time)
        handle = self._handlers.get(packet.port)
        answers = handle(packet) if handle else self._no_port(packet)
        self.firmware.link_statistics.count_sent(len(answers))
        return answers

    def step(self, voltage: float) -> MotorCommands:
        """Take a step and return the motor commands; see `Firmware.step`."""
        return self.firmware.step(voltage)

    def _no_port(self, packet):
        self.firmware.warn("port", f"CRTP: nothing listens on port {packet.port}")
        return []

    def unsolicited(self) -> list[Packet]:
        """Return the packets that answer no request: log data and console."""
        packets = self._log.collect()
        firmware = self.firmware
        while firmware.link_statistics.is_connected:
            piece = firmware.console.pop()
            if piece is None:
                break
            packets.append(Packet(Port.CONSOLE, 0, piece))
        firmware.link_statistics.count_sent(len(packets))
        return packets
