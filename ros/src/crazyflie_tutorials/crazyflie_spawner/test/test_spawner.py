"""Names, the node with vehicles that are not there, the launch file of one, and a process."""

import math
from concurrent.futures import Future
from pathlib import Path

import pytest
import rospkg

from crazyflie_spawner.spawner_node import SpawnerNode, VehicleProcess, vehicle_name
from crazyflie_tutorial_msgs.srv import RemoveVehicleRequest, SpawnVehicleRequest
from crazyflie_utils import ServiceError
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.testing import FakeProcess, launch_files, peer

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_spawner")) / "launch"


class FakeVehicle:
    """A vehicle that is there, and gone, when a test says so."""

    made: list = []

    def __init__(self, arguments):
        self.arguments = arguments
        self.status = None
        self.is_ending = False
        FakeVehicle.made.append(self)

    def end(self):
        self.is_ending = True


class Simulation:
    """A spawner, and what the master would know."""

    def __init__(self, parameters=()):
        FakeVehicle.made = []
        self.process = FakeProcess()
        self.node = type("Node", (SpawnerNode,), {"start_process": FakeVehicle})()
        assert self.process.launch(self.node, "/spawner", dict(parameters))

    def spawn(self, name="", x=0.0, y=0.0):
        answer = self.process.call("/spawn", SpawnVehicleRequest(name, x, y))
        return answer, FakeVehicle.made[-1]

    def come(self, name):
        self.process.transport.foreign_services[f"/{name}/takeoff"] = f"/{name}/composed"
        self.process.advance(0.5)

    def go(self, name, vehicle, status=0):
        self.process.transport.foreign_services.pop(f"/{name}/takeoff", None)
        vehicle.status = status
        self.process.advance(0.5)

    def remove(self, name):
        return self.process.call("/remove", RemoveVehicleRequest(name))


@pytest.fixture
def simulation():
    return Simulation()


@pytest.mark.parametrize("name", ["cf", "Cf_7", "rpr_crazyflie"])
def test_names(name):
    assert vehicle_name(name, ()) == name


@pytest.mark.parametrize("name", ["7", "a/b", "/a", "~a", "a b", "a-b", "_a", "ä", "a\n"])
def test_no_names(name):
    with pytest.raises(RefusalError, match="is not a name of a vehicle; expected letters"):
        vehicle_name(name, ())


def test_a_name_that_is_free():
    assert vehicle_name("", ()) == "crazyflie1"
    assert vehicle_name("", {"crazyflie1", "crazyflie3"}) == "crazyflie2"


def test_answers_when_the_vehicle_is_there(simulation):
    answer, vehicle = simulation.spawn("cf7", 2.0, -1.5)
    simulation.process.advance(5.0)
    assert not answer.done()
    simulation.come("cf7")
    assert answer.result().name == "cf7"
    assert vehicle.arguments[:2] == ["crazyflie_spawner", "vehicle.launch"]
    assert {"name:=cf7", "x:=2", "y:=-1.5", "sim_time:=true"} <= set(vehicle.arguments)


def test_two_at_a_time_have_names_of_their_own(simulation):
    first, second = simulation.spawn()[0], simulation.spawn()[0]
    simulation.come("crazyflie2")
    assert (first.done(), second.result().name) == (False, "crazyflie2")
    simulation.come("crazyflie1")
    assert first.result().name == "crazyflie1"


def test_removing_is_answered_when_it_is_gone(simulation):
    _, vehicle = simulation.spawn("cf7")
    simulation.come("cf7")
    answer = simulation.remove("cf7")
    simulation.process.advance(1.0)
    assert vehicle.is_ending
    assert isinstance(answer, Future)
    assert not answer.done()
    with pytest.raises(ServiceError, match="already"):
        simulation.spawn("cf7")
    simulation.go("cf7", vehicle)
    assert answer.done()
    simulation.spawn("cf7")


@pytest.mark.parametrize(
    ("name", "x", "reason"),
    [
        ("cf7", 0.0, "the vehicle cf7 exists already"),
        ("theirs", 0.0, "the vehicle theirs exists already, and was not spawned here"),
        ("cf 8", 0.0, "'cf 8' is not a name of a vehicle"),
        ("cf8", math.nan, r"the position is \(nan, 0\); expected finite numbers"),
    ],
)
def test_refusals(simulation, name, x, reason):
    simulation.spawn("cf7")
    simulation.come("cf7")
    simulation.come("theirs")
    with pytest.raises(ServiceError, match=reason):
        simulation.spawn(name, x)
    assert len(FakeVehicle.made) == 1


def test_a_vehicle_that_is_not_there_cannot_be_removed(simulation):
    simulation.spawn("cf7")
    with pytest.raises(ServiceError, match="no vehicle 'cf8' was spawned; spawned vehicles: cf7"):
        simulation.remove("cf8")


def test_a_vehicle_that_ends_before_it_is_there(simulation):
    answer, vehicle = simulation.spawn("cf7")
    simulation.go("cf7", vehicle, status=1)
    with pytest.raises(ServiceError, match=r"cf7 ended before it was ready \(status 1\)"):
        answer.result()
    simulation.spawn("cf7")


def test_a_vehicle_that_never_comes(simulation):
    answer, vehicle = simulation.spawn("cf7")
    simulation.process.advance(31.0)
    with pytest.raises(ServiceError, match="cf7 was not ready after 30 s"):
        answer.result()
    assert vehicle.is_ending
    simulation.go("cf7", vehicle)


def test_removed_before_it_is_there(simulation):
    answer, vehicle = simulation.spawn("cf7")
    removal = simulation.remove("cf7")
    simulation.go("cf7", vehicle)
    assert removal.done()
    assert isinstance(answer.exception(), ServiceError)


def test_a_vehicle_that_crashes_is_told(simulation):
    _, vehicle = simulation.spawn("cf7")
    simulation.come("cf7")
    simulation.go("cf7", vehicle, status=1)
    assert "cf7 has ended by itself (status 1)" in simulation.process.logged("warn")[0]


def test_one_from_the_beginning_and_all_end_with_the_node():
    simulation = Simulation({"vehicle": "first"})
    simulation.spawn()
    assert "name:=first" in FakeVehicle.made[0].arguments
    simulation.process.shut_down({"/spawner": simulation.node})
    assert all(vehicle.is_ending for vehicle in FakeVehicle.made)


def test_launch_file_of_a_vehicle():
    nodes, parameters = launch_files.expand(LAUNCH / "vehicle.launch", name="cf7", x=2.0, y=1.0)
    assert all(name.startswith("/cf7/") for name in nodes)
    assert parameters["/cf7/takeoff_server/srv/takeoff"] == "takeoff"
    assert parameters["/cf7/takeoff_server/hover/x"] == parameters["/cf7/simulator/init/x"] == 2.0
    assert parameters["/cf7/simulator/frames/robot"] == "cf7"
    topics = [value for name, value in parameters.items() if "/topics/" in name]
    assert topics
    assert not [topic for topic in topics if str(topic).startswith("/")]


def test_a_process_is_told_to_end(tmp_path, monkeypatch):
    program = tmp_path / "roslaunch"
    program.write_text('#!/bin/sh\ntrap "exit 3" INT\ntouch "$1"\nwhile :; do sleep 0.05; done\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    begun = tmp_path / "begun"
    process = VehicleProcess([str(begun)])
    peer.wait_until(begun.exists, "the program")
    assert process.status is None
    process.end()
    peer.wait_until(lambda: process.status is not None, "the end")
    assert process.status == 3


def test_a_process_that_does_not_end_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr("crazyflie_spawner.spawner_node.END_LIMIT", 0.2)
    program = tmp_path / "roslaunch"
    program.write_text('#!/bin/sh\ntrap "" INT\ntouch "$1"\nwhile :; do sleep 0.05; done\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    begun = tmp_path / "begun"
    process = VehicleProcess([str(begun)])
    peer.wait_until(begun.exists, "the program")
    process.end()
    peer.wait_until(lambda: process.status is not None, "the end")
    assert process.status == -9
