"""The vehicle that tests of the link talk to."""

import socket
import threading

from crazyflie_link.testing.fake_vehicle import FakeVehicle

PING = bytes([0xFC])
POSITION = bytes([0x7C, 7]) + bytes(16)


def test_what_is_sent_to_a_frozen_vehicle_is_lost_also_if_its_thread_is_late():
    goes_on = threading.Event()
    with FakeVehicle() as vehicle, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        vehicle.lose = lambda _: goes_on.wait()
        sender.sendto(PING, ("127.0.0.1", vehicle.port))
        vehicle.wait_for_packets(15, 0)
        vehicle.is_frozen = True
        sender.sendto(POSITION, ("127.0.0.1", vehicle.port))
        threading.Timer(0.1, goes_on.set).start()
        vehicle.is_frozen = False
        vehicle.lose = lambda _: False
        sender.sendto(PING, ("127.0.0.1", vehicle.port))
        vehicle.wait_for_packets(15, 0, 2)
        assert vehicle.received == [(15, 0, b""), (15, 0, b"")]
        assert vehicle.broadcasts == []
