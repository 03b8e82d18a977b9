"""The true pose as a datagram."""

import socket
import time

import pytest

from crazyflie_virtual.observer import Observation, decode
from crazyflie_virtual.server import VehicleServer
from crazyflie_virtual.settings import VehicleSettings

LIMIT = 60.0


def test_observations_come_back():
    observation = Observation(
        7, "ünder", 12.5, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.0, 0.0, 0.6, 0.8), (7.0, 8.0, 9.0)
    )
    assert decode(observation.encode()) == observation


def test_rubbish_is_no_observation():
    assert decode(b"") is None
    assert decode(bytes(200)) is None


@pytest.mark.parametrize(("port", "name"), [(19850, "cf1"), (19859, "cf10"), (17850, "cf17850")])
def test_names_follow_from_ports(port, name):
    try:
        server = VehicleServer(VehicleSettings(port=port, observer_port=0))
    except OSError:
        pytest.skip(f"port {port} is taken")
    try:
        assert server.observe().name == name
    finally:
        server.stop()


def test_a_vehicle_tells_its_observer():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as observer:
        observer.bind(("127.0.0.1", 0))
        observer.settimeout(LIMIT)
        port = observer.getsockname()[1]
        server = VehicleServer(VehicleSettings(port=0, observer_port=port, body_id=5, init_y=2.0))
        server.start()
        try:
            first, second = (decode(observer.recv(1024)) for _ in range(2))
        finally:
            server.stop()
    assert (first.body_id, first.position) == (5, (0.0, 2.0, 0.0))
    assert first.time < second.time <= time.monotonic()


@pytest.mark.parametrize("moments", [(0.2999, 0.3001), (0.0048, 0.0051)])
def test_after_a_stall_no_two_observations_have_the_same_time(moments):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as observer:
        observer.bind(("127.0.0.1", 0))
        observer.setblocking(False)
        port = observer.getsockname()[1]
        server = VehicleServer(VehicleSettings(port=0, observer_port=port))
        begin = server.observe().time
        try:
            for moment in moments:
                server._process(begin + moment, [])
        finally:
            server.stop()
        assert decode(observer.recv(1024)).time == pytest.approx(begin + moments[0])
        with pytest.raises(BlockingIOError):
            observer.recv(1024)
