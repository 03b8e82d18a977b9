"""The driver runs again from its journal, without its vehicles."""

import pytest
from conftest import Server, result
from safety_helpers import LAND, TAKEOFF, commands, position, thrust
from std_srvs.srv import EmptyRequest, SetBoolRequest

from crazyflie_driver.setpoint_topics import SETPOINTS
from crazyflie_driver.srv import UpdateParamsRequest
from crazyflie_link.crazyflie import LinkState
from crazyflie_utils import ServiceError
from crazyflie_utils.journal.journal_file import Journal, JournalWriter, Kind
from crazyflie_utils.journal.recording import Recorder
from crazyflie_utils.journal.replay import Replay
from crazyflie_utils.journal.replay_transport import DifferenceError
from crazyflie_utils.testing.programs import wait_until

HEADER = {"node": "/crazyflie_server", "program": "", "clock": "manual", "start": 100.0, "us": 0}


@pytest.fixture
def recorded(tmp_path):
    """Return a function that has a function fly a server, and returns the path of its journal."""

    def record(fly):
        path = tmp_path / "driver.journal"
        recorder = Recorder(JournalWriter(path, HEADER, 1e9, print))
        server = Server(recorder=recorder)
        try:
            fly(server)
            server.process.shut_down({"/crazyflie_server": server.node})
        finally:
            recorder.close()
            for vehicle in server.vehicles:
                vehicle.close()
        return path

    return record


def replay(path):
    """Run a journal again to its end; return how many rows of each kind it has."""
    with Replay(Journal(path)) as again:
        assert again.start()
        while again.step():
            pass
    return again.rows.counts


def fly(server):
    """Add a vehicle and fly it with commands and setpoints."""
    vehicle = server.make_vehicle()
    result(server.begin_adding(vehicle.uri))
    thrust(server, 0.0)
    server.process.transport.parameters["/cf1/ring/effect"] = 3
    server.call("/cf1/update_params", UpdateParamsRequest(["ring/effect"]))
    server.call("/cf1/takeoff", TAKEOFF)
    server.process.advance(0.6)
    position(server)
    vehicle.wait_for_packets(7, 0)
    server.process.advance(0.1)
    server.call("/cf1/land", LAND)
    server.process.advance(0.5)
    return vehicle


def lose_link(server):
    """Lose the link of a vehicle that flies, until it gets a new one."""
    vehicle = fly(server)
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie.target
    vehicle.is_frozen = True
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    with pytest.raises(ServiceError):
        server.call("/cf1/takeoff", TAKEOFF)
    thrust(server)
    vehicle.is_frozen = False
    wait_until(lambda: crazyflie.state is LinkState.CONNECTED, "the new link")

    def is_connected():
        server.process.advance(0.1)
        return server.process.published("/cf1/connected")[-1].data

    wait_until(is_connected, "that it is published")
    server.call("/cf1/arm", SetBoolRequest(True))


def stop(server):
    """Stop a swarm that flies, and remove a vehicle."""
    vehicles = [server.make_vehicle() for _ in range(2)]
    for k, vehicle in enumerate(vehicles):
        result(server.begin_adding(vehicle.uri, f"cf{k + 1}"))
    server.call("/crazyflie_server/all/takeoff", TAKEOFF)
    server.process.advance(1.0)
    server.process.call("/crazyflie_server/all/emergency", EmptyRequest())
    wait_until(lambda: all(commands(each)[-1] == (7, 0) for each in vehicles), "the stop")
    server.remove(vehicles[0].uri)


@pytest.mark.parametrize("flight", [fly, lose_link, stop])
def test_a_flight_of_the_driver_runs_again_to_the_bit(recorded, flight):
    counts = replay(recorded(flight))
    assert counts[Kind.PUBLISHED] > 10
    assert counts[Kind.TASK] > 10
    assert counts[Kind.SUBMITTED] > 10


def test_a_driver_that_sends_something_else_is_different(recorded, monkeypatch):
    path = recorded(fly)
    sender = SETPOINTS["cmd_position"]
    changed = sender._replace(send=lambda c, m: c.setpoints.position(m.x, m.y, m.z + 0.5, m.yaw))
    monkeypatch.setitem(SETPOINTS, "cmd_position", changed)
    with pytest.raises(DifferenceError, match=r"position\(0.0, 0.0, 1.5, 0.0\)"):
        replay(path)
