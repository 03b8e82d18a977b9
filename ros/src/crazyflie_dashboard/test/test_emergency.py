"""Calls of emergencies: services that answer, are stopped, gone or moved, and a lost master."""

import io
import socket
import struct
import threading

import pytest
from rosgraph.network import read_ros_handshake_header, write_ros_handshake_header
from std_srvs.srv import Empty

from crazyflie_dashboard.emergency import ALL, EmergencyLane
from crazyflie_utils.testing.programs import wait_until

LIMIT = 30.0


class Service:
    """A node with one service: takes connections as rospy does, and keeps what it is asked."""

    def __init__(self, name, calls):
        self.name, self.calls, self.answer = name, calls, b"\1\0\0\0\0"
        self.is_running = threading.Event()
        self.is_running.set()
        self.connections = []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"rosrpc://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self._accept, daemon=True).start()

    def end(self):
        # A shutdown wakes the thread that accepts; without it the port would stay.
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        for each in self.connections:
            each.shutdown(socket.SHUT_RDWR)

    def _accept(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self.connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection):
        self.is_running.wait()
        header = read_ros_handshake_header(connection, io.BytesIO(), 4096)
        assert header["md5sum"] == Empty._md5sum
        assert header["persistent"] == "1"
        write_ros_handshake_header(connection, {"callerid": "/node"})
        while connection.recv(4) == struct.pack("<I", 0):
            self.is_running.wait()
            self.calls.append(self.name)
            connection.sendall(self.answer)


class Bench:
    """A master in numbers, its services, and a lane."""

    def __init__(self, *names):
        self.calls, self.reports = [], []
        self.is_master_there = True
        self.nodes = {name: Service(name, self.calls) for name in names}
        self.caller = "/test"
        self.lane = EmergencyLane(self, self.reports.append)

    # The master.

    def services(self):
        if not self.is_master_there:
            raise OSError("no answer of the master")
        nodes = {name: f"/node{id(service)}" for name, service in self.nodes.items()}
        return {**nodes, "/cf1/land": "/node", "/cf1/high_level/emergency": "/node"}

    def lookup(self, name):
        if not self.is_master_there:
            raise OSError("no answer of the master")
        return self.nodes[name].address

    def wait(self):
        wait_until(lambda: set(self.lane.ready) == self.nodes.keys(), "connections", LIMIT)

    def stop(self, services=None, age=0.0):
        return self.lane.stop(services, age).result(LIMIT)


@pytest.fixture
def bench():
    found = Bench("/cf1/emergency", "/cf2/emergency", *ALL)
    yield found
    found.lane.close()


def test_all_are_told_without_a_master_over_connections_that_were_open(bench):
    bench.wait()
    bench.is_master_there = False
    accepted = [len(each.connections) for each in bench.nodes.values()]
    for _ in range(3):
        assert bench.stop() == dict.fromkeys((*ALL, "/cf1/emergency", "/cf2/emergency"), "")
    assert sorted(bench.calls) == sorted(3 * list(bench.nodes))
    assert accepted == [len(each.connections) for each in bench.nodes.values()]
    assert bench.reports[-1] == "emergency for all vehicles: all services have answered"


def test_a_node_that_has_stopped_delays_no_other_and_is_named(bench):
    bench.wait()
    stopped = bench.nodes[ALL[0]]
    stopped.is_running.clear()
    result = bench.lane.stop(None, 0.0)
    others = set(bench.nodes) - {ALL[0]}
    wait_until(lambda: set(bench.calls) == others, "the others", LIMIT)
    assert not result.done()
    # A second click does not wait for the answer of the first.
    assert bench.stop(["/cf1/emergency"]) == {"/cf1/emergency": ""}
    texts = result.result(LIMIT)
    assert texts == {**dict.fromkeys(others, ""), ALL[0]: "it has not answered within 5 s"}
    assert f"{ALL[0]}: it has not answered within 5 s" in bench.reports[-1]
    stopped.is_running.set()


def test_a_node_that_has_gone_is_named_and_one_that_was_started_again_is_told(bench):
    bench.wait()
    bench.nodes["/cf1/emergency"].end()
    bench.nodes["/cf2/emergency"].end()
    bench.nodes["/cf2/emergency"] = Service("/cf2/emergency", bench.calls)
    texts = bench.stop()
    assert "Connection refused" in texts.pop("/cf1/emergency")
    assert texts == dict.fromkeys((*ALL, "/cf2/emergency"), "")


def test_a_refusal_is_in_the_words_of_the_service(bench):
    bench.wait()
    bench.nodes["/cf1/emergency"].answer = b"\0" + struct.pack("<I", 7) + b"no link"
    assert bench.stop(["/cf1/emergency"]) == {"/cf1/emergency": "no link"}


def test_it_counts_for_five_seconds(bench):
    bench.wait()
    assert bench.stop(["/cf1/emergency"], age=4.9) == {"/cf1/emergency": ""}
    assert "nothing was done" in bench.stop(["/cf1/emergency"], age=5.1)["emergency"]
    assert "nothing was done" in bench.stop(["/cf1/emergency"], age=float("nan"))["emergency"]
    assert bench.calls == ["/cf1/emergency"]


def test_a_service_that_is_named_twice_is_called_once(bench):
    bench.wait()
    assert bench.stop(["/cf1/emergency", "/cf1/emergency"]) == {"/cf1/emergency": ""}
    assert bench.calls == ["/cf1/emergency"]


def test_without_a_service_it_says_why():
    bench = Bench()
    bench.is_master_there = False
    wait_until(lambda: "no answer" in bench.stop()["emergency"], "the reason", LIMIT)
    bench.lane.close()
