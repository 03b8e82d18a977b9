"""Ports 3 and 7: streamed setpoints."""

from crazyflie_virtual.firmware.firmware import Firmware
from crazyflie_virtual.firmware.setpoints import decode_generic

_SETPOINT, _META = 0, 1
_SETPOINTS_STOP = b"\0"


def handle_attitude(firmware: Firmware, channel: int, data: bytes) -> None:
    """Process an attitude setpoint; there is no answer."""
    f = firmware
    if channel != _SETPOINT:
        f.warn("setpoint", f"CMD: unknown channel {channel}")
        return
    setpoint = f.attitude_decoder.decode(data, f.commander.priority, f.time)
    if setpoint is None:
        f.warn("setpoint", "CMD: an attitude setpoint of less than 14 bytes")
        return
    f.stream(setpoint)
    if f.attitude_decoder.is_locked:
        f.warn("thrust", "CMD: thrust is locked until a setpoint without thrust comes")


def handle_generic(firmware: Firmware, channel: int, data: bytes) -> None:
    """Process a setpoint of another type or the end of streaming; there is no answer."""
    f = firmware
    if channel == _SETPOINT:
        setpoint = decode_generic(data, f.time)
        if setpoint is None:
            f.warn("setpoint", f"CMD: no setpoints of type {data[:1].hex()}")
        else:
            f.stream(setpoint)
    elif channel == _META and data[:1] == _SETPOINTS_STOP:
        f.commander.relax_priority(f.estimate)
    else:
        f.warn("setpoint", f"CMD: unknown command {channel}/{data[:1].hex()}")
