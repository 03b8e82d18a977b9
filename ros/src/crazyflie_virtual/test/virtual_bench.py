"""A virtual vehicle on the bench: no sockets, and time moved by hand."""

import struct
from unittest.mock import MagicMock

from cflib.crazyflie import Crazyflie

from crazyflie_virtual import crtp
from crazyflie_virtual.crtp import Packet, Port
from crazyflie_virtual.settings import VehicleSettings
from crazyflie_virtual.vehicle import VirtualVehicle


class Bench:
    """A vehicle, and what it has sent without being asked."""

    def __init__(self, **options):
        self.vehicle = VirtualVehicle(VehicleSettings(**options))
        self.unsolicited = []
        self.run(0.2)

    @property
    def firmware(self):
        return self.vehicle.board.firmware

    @property
    def physics(self):
        return self.vehicle.physics

    @property
    def height(self):
        return self.vehicle.physics.position[2]

    @property
    def motors_run(self):
        return any(self.firmware.stabilizer.commands)

    def ask(self, port, channel, data):
        """Send a packet; return the answers."""
        answers = self.vehicle.receive(Packet(port, channel, data).encode())
        return [crtp.decode(answer) for answer in answers]

    def ask_one(self, port, channel, data):
        """Send a packet that has one answer; return its data."""
        (answer,) = self.ask(port, channel, data)
        assert (answer.port, answer.channel) == (port, channel)
        return answer.data

    def run(self, duration):
        """Advance the time."""
        end = self.vehicle.time + duration
        self.unsolicited += map(crtp.decode, self.vehicle.advance_to(end + 1e-9))

    def stream(self, packet, duration, period=0.02):
        """Send a packet again and again while time passes."""
        for _ in range(round(duration / period)):
            assert self.ask(*packet) == []
            self.run(period)

    def unlock(self):
        """Open the thrust lock."""
        self.ask(*attitude(thrust=0))

    def take_off(self, height=1.0, duration=2.0):
        """Take off by the high-level commander and wait until it hovers."""
        data = struct.pack("<BBff?f", 7, 0, height, 0.0, False, duration)
        assert self.ask_one(Port.HIGH_LEVEL, 0, data)[3] == 0
        self.run(duration + 3.0)
        assert abs(self.height - height) < 0.15


def attitude(roll=0.0, pitch=0.0, yaw_rate=0.0, thrust=42000):
    """Return an attitude setpoint as it is on the wire."""
    return (Port.SETPOINT, 0, struct.pack("<fffH", roll, pitch, yaw_rate, thrust))


def generic(setpoint_type, form, *values):
    """Return a generic setpoint as it is on the wire."""
    return (Port.GENERIC_SETPOINT, 0, struct.pack("<B" + form, setpoint_type, *values))


SETPOINTS_STOP = (Port.GENERIC_SETPOINT, 1, struct.pack("<BI", 0, 0))


def cflib_client(protocol=12):
    """Return a cflib object that is not connected, and the list of packets that it sends."""
    client = Crazyflie()
    sent = []
    client.link = MagicMock(needs_resending=False)
    client.link.send_packet.side_effect = lambda p: sent.append(
        Packet(p.port, p.channel, bytes(p.data))
    )
    client.platform._protocolVersion = protocol
    return client, sent


def command(bench, method, *arguments, protocol=12, **keywords):
    """Send what cflib's high-level commander sends; return the error number."""
    client, sent = cflib_client(protocol)
    getattr(client.high_level_commander, method)(*arguments, **keywords)
    (packet,) = sent
    answer = bench.ask_one(packet.port, packet.channel, packet.data)
    assert len(answer) == 4
    assert answer[:2] == packet.data[:2]
    return answer[3]
