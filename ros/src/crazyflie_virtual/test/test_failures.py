"""Faults as seen by cflib, and the faults of the link in figures."""

import contextlib
import signal
import socket
import subprocess
import sys
import time

import pytest
from virtual_client import LIMIT, Client

from crazyflie_utils.testing.programs import free_port, wait_until
from crazyflie_virtual.firmware.supervisor import State


@pytest.fixture
def client():
    """Return ``client(uri)``; all are closed at the end."""
    clients = []

    def client(uri):
        clients.append(Client(uri))
        return clients[-1]

    yield client
    for each in clients:
        each.close()


@pytest.fixture
def process():
    """Return a virtual vehicle in a process of its own, without ROS, and its URI."""
    command = [sys.executable, "-m", "crazyflie_virtual", "--port", "0", "--observer-port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    yield process, process.stdout.readline().split()[-1]
    process.kill()
    process.wait(LIMIT)
    process.stdout.close()


def test_port_closed_is_a_failed_connection(client):
    someone = client(f"udp://127.0.0.1:{free_port()}").open()
    someone.wait_for("connection_failed")
    assert "connected" not in someone.events


def test_silence_from_the_start_connects_nobody(serve, client):
    server, uri = serve(silence=1e6)
    someone = client(uri).open()
    # Several times as long as it takes to connect, it hears nothing, not even a failure.
    wait_until(lambda: server.vehicle.time > 0.8)
    assert someone.events == {}
    assert not someone.cf.is_connected()


def test_peer_gone_is_a_lost_connection(process, client):
    vehicle, uri = process
    someone = client(uri).open()
    someone.wait_for("fully_connected")
    vehicle.kill()
    someone.wait_for("connection_lost")
    # Without a word.
    someone.cf.commander.send_setpoint(0.0, 0.0, 0.0, 30000)


def test_the_process_ends_when_it_is_asked_to(process):
    vehicle, _ = process
    vehicle.send_signal(signal.SIGTERM)
    assert vehicle.wait(LIMIT) == 0


def test_frozen_peer_still_looks_connected(connect):
    vehicle, someone = connect()
    rows = someone.log("stateEstimate.z")
    someone.cf.high_level_commander.takeoff(0.3, 0.5)
    wait_until(lambda: vehicle.physics.position[2] > 0.2)
    vehicle.faults.silence = 1e6
    age = vehicle.time
    wait_until(lambda: vehicle.time > age + 0.1)
    heard = len(rows)
    wait_until(lambda: vehicle.time > age + 0.6)
    assert len(rows) == heard
    assert someone.cf.is_connected()
    assert "connection_lost" not in someone.events
    # The vehicle flies on, and is heard again after the silence.
    assert vehicle.physics.position[2] > 0.2
    vehicle.faults.silence = 0.2
    wait_until(lambda: len(rows) > heard)
    assert vehicle.faults.silence == 0.0


def test_silence_while_streaming_meets_the_watchdogs(connect):
    vehicle, someone = connect()
    supervisor = vehicle.board.firmware.supervisor

    def stream_until(condition):
        def step():
            someone.cf.commander.send_hover_setpoint(0.0, 0.0, 0.0, 0.3)
            return condition()

        wait_until(step)

    stream_until(lambda: vehicle.physics.position[2] > 0.2)
    # Its answer is silenced, too.
    someone.cf.param.set_value("virtual.silence", 1000.0)
    stream_until(lambda: supervisor.state is State.WARNING_LEVEL_OUT)
    stream_until(lambda: supervisor.state is State.LOCKED)
    stream_until(lambda: vehicle.physics.position[2] == 0.0)


def echoes(server, count, limit):
    """Send pings; return how many come back, each within a limit (s)."""
    heard = 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pinger:
        pinger.settimeout(limit)
        # No more at a time than fit into the buffers of the sockets.
        for _ in range(count // 100):
            for k in range(100):
                pinger.sendto(b"\xfc" + bytes([k]), server.address)
            received = 0
            with contextlib.suppress(TimeoutError):
                while received < 100:
                    pinger.recv(64)
                    received += 1
            heard += received
    return heard


def test_packets_are_lost_both_ways(serve):
    assert echoes(serve()[0], 400, LIMIT) == 400
    # Half of them on the way there, half of the others on the way back.
    assert echoes(serve(loss=0.5)[0], 400, 0.3) == pytest.approx(100, abs=50)


def test_packets_are_late_both_ways(serve):
    server, _ = serve(delay=0.1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pinger:
        pinger.settimeout(LIMIT)
        begin = time.monotonic()
        pinger.sendto(b"\xfcping", server.address)
        assert pinger.recv(64) == b"\xfcping"
        assert time.monotonic() - begin >= 0.2
