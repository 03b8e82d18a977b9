"""Ports 3 and 7: streamed setpoints."""

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware.setpoints import decode_generic
from crazyflie_virtual.link.crtp import Packet, Port

_SETPOINT, _META = 0, 1
_SETPOINTS_STOP = 0


class AttitudeSetpointPort:
    """Attitude setpoints.

    Parameters
    ----------
    firmware : Firmware
    """

    port = Port.SETPOINT

    def __init__(self, firmware: Firmware):
        self._firmware = firmware

    def handle(self, packet: Packet) -> list[Packet]:
        """Take a setpoint; there is no answer."""
        f = self._firmware
        if packet.channel == _SETPOINT:
            setpoint = f.attitude_decoder.decode(packet.data, f.commander.priority, f.time)
            if setpoint is None:
                f.warn("setpoint", "CMD: an attitude setpoint of less than 14 bytes")
                return []
            f.stream(setpoint)
            if f.attitude_decoder.is_locked:
                f.warn("thrust", "CMD: thrust is locked until a setpoint without thrust comes")
        else:
            f.warn("setpoint", f"CMD: unknown channel {packet.channel}")
        return []


class GenericSetpointPort:
    """Setpoints of all other types, and the end of streaming.

    Parameters
    ----------
    firmware : Firmware
    """

    port = Port.GENERIC_SETPOINT

    def __init__(self, firmware: Firmware):
        self._firmware = firmware

    def handle(self, packet: Packet) -> list[Packet]:
        """Take a setpoint or a command; there is no answer."""
        f = self._firmware
        if packet.channel == _SETPOINT:
            setpoint = decode_generic(packet.data, f.time)
            if setpoint is None:
                f.warn("setpoint", f"CMD: no setpoints of type {packet.data[:1].hex()}")
                return []
            f.stream(setpoint)
        elif packet.channel == _META and packet.data[:1] == bytes([_SETPOINTS_STOP]):
            f.commander.relax_priority(f.estimate)
        else:
            head = packet.data[:1].hex()
            f.warn("setpoint", f"CMD: unknown command {packet.channel}/{head}")
        return []
