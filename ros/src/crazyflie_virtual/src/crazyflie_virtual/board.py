"""The microcontroller: firmware and ports, from power-up on."""

from collections.abc import Callable
from functools import partial

from crazyflie_virtual.body.physics import Physics
from crazyflie_virtual.faults import FaultSwitches
from crazyflie_virtual.firmware.firmware import SUPERVISOR_PROTOCOL, Firmware
from crazyflie_virtual.firmware.localization import DECK
from crazyflie_virtual.link.crtp import Packet, Port
from crazyflie_virtual.ports import high_level, link, platform, setpoints, supervisor
from crazyflie_virtual.ports.localization import LocalizationPort
from crazyflie_virtual.ports.log import LogPort
from crazyflie_virtual.ports.memory import MemoryPort
from crazyflie_virtual.ports.parameters import ParameterPort
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.tables.decks import decks
from crazyflie_virtual.tables.memories import LighthouseMemory, eeprom, memories

_ADDRESS_PREFIX = 0xE7E7E7E700


class Storage:
    """Memories and stored parameters, which persist over a restart."""

    def __init__(self, settings: VehicleSettings):
        self.eeprom = eeprom(_ADDRESS_PREFIX | settings.address)
        self.one_wire = [
            (deck.serial, deck.one_wire())
            for deck in decks(settings.positioning == DECK, settings.multiranger)
        ]
        self.lighthouse: dict[int, bytes] = {}
        self.parameters: dict[str, float] = {}


class Board:
    """A running firmware behind its ports; for ``failure`` see `Firmware`."""

    def __init__(
        self,
        physics: Physics,
        faults: FaultSwitches,
        settings: VehicleSettings,
        storage: Storage,
        failure: str = "",
    ):
        firmware = self.firmware = Firmware(physics, faults, settings, failure)
        self._log = LogPort(firmware)
        lighthouse = LighthouseMemory(storage.lighthouse)
        memory = MemoryPort(
            memories(
                storage.eeprom,
                firmware.planner.memory,
                firmware.memory_tester,
                lighthouse,
                storage.one_wire,
            ),
            firmware.warn,
        )
        self._handlers: dict[int, Callable[[int, bytes], bytes | None]] = {
            Port.LINK: partial(link.handle, firmware),
            Port.PLATFORM: partial(platform.handle, firmware),
            Port.LOG: self._log.handle,
            Port.PARAMETERS: ParameterPort(firmware, storage.parameters).handle,
            Port.MEMORY: memory.handle,
            Port.SETPOINT: partial(setpoints.handle_attitude, firmware),
            Port.GENERIC_SETPOINT: partial(setpoints.handle_generic, firmware),
            Port.HIGH_LEVEL: partial(high_level.handle, firmware),
            Port.LOCALIZATION: LocalizationPort(firmware, settings.address, lighthouse).handle,
        }
        if settings.protocol >= SUPERVISOR_PROTOCOL:
            self._handlers[Port.SUPERVISOR] = partial(supervisor.handle, firmware)

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
        packets = self._log.collect()
        firmware = self.firmware
        while firmware.link_statistics.is_connected:
            piece = firmware.console.pop()
            if piece is None:
                break
            packets.append(Packet(Port.CONSOLE, 0, piece))
        firmware.link_statistics.count_sent(len(packets))
        return packets
