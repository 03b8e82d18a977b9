"""The microcontroller: firmware and services, from power-up on."""

from crazyflie_virtual import memories
from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.memories import Memory
from crazyflie_virtual.services.high_level import HighLevelService
from crazyflie_virtual.services.link import LinkService
from crazyflie_virtual.services.localization import LocalizationService
from crazyflie_virtual.services.log import LogService
from crazyflie_virtual.services.memory import MemoryService
from crazyflie_virtual.services.parameters import ParameterService
from crazyflie_virtual.services.platform import PlatformService
from crazyflie_virtual.services.setpoints import AttitudeSetpointService, GenericSetpointService
from crazyflie_virtual.services.supervisor import SupervisorService

_ADDRESS_PREFIX = 0xE7E7E7E700


class Storage:
    """What outlives a restart: configuration memory and stored parameters.

    Parameters
    ----------
    address : int
        Last byte of the radio's.
    """

    def __init__(self, address: int):
        self.eeprom = memories.eeprom(_ADDRESS_PREFIX | address)
        self.parameters = {}


class Board:
    """A running firmware behind its ports.

    Parameters
    ----------
    physics : Physics
    faults : Faults
    settings : Settings
    storage : Storage
    """

    def __init__(self, physics, faults, settings, storage: Storage):
        firmware = self.firmware = Firmware(physics, faults, settings)
        supervisor = SupervisorService(firmware)
        self._log = LogService(firmware)
        services = (
            LinkService(firmware.new_client),
            PlatformService(settings.protocol, supervisor),
            self._log,
            ParameterService(firmware, storage.parameters),
            MemoryService(
                (
                    Memory.over(memories.EEPROM, storage.eeprom),
                    Memory.over(memories.TRAJECTORY, firmware.planner.memory),
                    firmware.memory_tester.memory(),
                )
            ),
            AttitudeSetpointService(firmware),
            GenericSetpointService(firmware),
            HighLevelService(firmware),
            LocalizationService(firmware, settings.address),
            supervisor,
        )
        self._services = {service.port: service for service in services}

    def receive(self, packet: Packet) -> list:
        """Return the answers to a packet."""
        self.firmware.link_statistics.count_received(self.firmware.time)
        service = self._services.get(packet.port)
        answers = service.handle(packet) if service else []
        self.firmware.link_statistics.count_sent(len(answers))
        return answers

    def step(self, voltage: float) -> tuple:
        """Take a step and return the motor commands; see `Firmware.step`."""
        return self.firmware.step(voltage)

    def unsolicited(self) -> list:
        """Return the packets that are sent without being asked for: log and console."""
        packets = self._log.collect()
        firmware = self.firmware
        while firmware.link_statistics.is_connected:
            piece = firmware.console.pop()
            if piece is None:
                break
            packets.append(Packet(Port.CONSOLE, 0, piece))
        firmware.link_statistics.count_sent(len(packets))
        return packets
