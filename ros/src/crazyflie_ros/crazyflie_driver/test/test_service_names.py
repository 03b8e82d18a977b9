"""Services whose names belong to other nodes."""

import time

import pytest

from crazyflie_driver import services as module
from crazyflie_driver.srv import StopRequest

CONTROLLER = "/cf1/controller"
GAINS = {"/cf1/controller/PIDs/X/kp": 40.0, "/cf1/other/kp": 1.0, "/cf1/flag": True}


def names(server):
    return {name for name in server.process.transport.services if name.startswith("/cf1/")}


def test_names_of_others_are_left_to_them(server):
    server.process.transport.foreign_services["/cf1/stop"] = "/cf1/mission"
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    assert "/cf1/driver/stop" in names(server)
    assert "/cf1/stop" not in names(server)
    assert {"/cf1/takeoff", "/cf1/land", "/cf1/emergency"} < names(server)
    (text,) = server.process.logged("warn")
    assert "/cf1/stop is a service of /cf1/mission: the driver's is /cf1/driver/stop" in text
    vehicle.received.clear()
    server.call("/cf1/driver/stop", StopRequest(3))
    assert vehicle.packets(8, 0) == [b"\x03\x03"]


def test_names_that_have_become_free_are_taken(server):
    server.process.transport.foreign_services["/cf1/stop"] = "/cf1/mission"
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    server.remove(vehicle.uri)
    assert names(server) == set()
    server.process.transport.foreign_services.clear()
    server.add(vehicle.uri)
    assert "/cf1/stop" in names(server)


def test_a_controller_that_has_parameters_is_waited_for(server, monkeypatch):
    server.process.transport.parameters.update(GAINS)
    monkeypatch.setattr(module, "CONTROLLER_LIMIT", 60.0)
    adding = server.begin_adding(server.make_vehicle().uri)
    with pytest.raises(TimeoutError):
        adding.result(timeout=0.5)
    services = server.process.transport.foreign_services
    services["/cf1/takeoff"] = CONTROLLER
    with pytest.raises(TimeoutError):
        adding.result(timeout=0.5)
    services["/cf1/land"] = CONTROLLER
    adding.result(timeout=120.0)
    assert {"/cf1/driver/takeoff", "/cf1/driver/land"} < names(server)
    assert not names(server) & {"/cf1/takeoff", "/cf1/land"}


def test_a_controller_whose_services_have_other_names_takes_none_away(server, monkeypatch):
    server.process.transport.parameters.update(GAINS)
    monkeypatch.setattr(module, "CONTROLLER_LIMIT", 60.0)
    server.process.transport.foreign_services.update(
        {"/cf1/controller/takeoff": CONTROLLER, "/cf1/controller/land": CONTROLLER}
    )
    server.add(server.make_vehicle().uri)
    assert {"/cf1/takeoff", "/cf1/land"} < names(server)


def test_parameters_that_were_left_behind_cost_a_moment_only(server, monkeypatch):
    server.process.transport.parameters.update(GAINS)
    monkeypatch.setattr(module, "CONTROLLER_LIMIT", 0.3)
    begin = time.monotonic()
    server.add(server.make_vehicle().uri)
    assert time.monotonic() - begin >= 0.3
    assert {"/cf1/takeoff", "/cf1/land"} < names(server)


def test_a_vehicle_can_be_removed_while_a_controller_is_waited_for(server, monkeypatch):
    server.process.transport.parameters.update(GAINS)
    monkeypatch.setattr(module, "CONTROLLER_LIMIT", 60.0)
    vehicle = server.make_vehicle()
    adding = server.begin_adding(vehicle.uri)
    vehicle.wait_for_packets(4, 0)
    server.remove(vehicle.uri)
    assert adding.exception(timeout=120.0) is not None
    assert names(server) == set()
