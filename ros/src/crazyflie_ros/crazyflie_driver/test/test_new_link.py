"""A new link to a vehicle that flies, and the end of one: nothing that is sent stops its motors."""

import threading
from concurrent.futures import Future
from unittest.mock import Mock

import pytest
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    READY,
    TAKEOFF,
    UNLOCKED,
    begin_removing,
    commands,
    is_,
    stream_position,
    thrust,
    wait_for_words,
)

from crazyflie_driver.services import ParameterMirror, VehicleServices
from crazyflie_driver.srv import SetGroupMaskRequest, UpdateParamsRequest
from crazyflie_link.crazyflie import Crazyflie, LinkState
from crazyflie_link.errors import LinkLostError
from crazyflie_model.supervisor import SupervisorState
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.testing import READ_ONLY, virtual_vehicle

LIMIT = 60.0

pytestmark = pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")

OLD = 11
"""The last protocol version in which the supervisor cannot be asked for its state."""


def make_old_vehicle(server, state=None):
    """Return a vehicle that only its log tells the state of, or nothing."""
    vehicle = server.make_vehicle(protocol=OLD)
    if state is None:
        del vehicle.log["supervisor.info"]
    else:
        is_(vehicle, state)
    return vehicle


def warnings(server):
    return " ".join(server.process.logged("warn"))


@pytest.mark.parametrize("state", [FLYING, None])
def test_a_vehicle_that_may_fly_is_added_and_removed_without_zeros(server, state):
    vehicle = make_old_vehicle(server, state)
    server.add(vehicle.uri)
    assert "may be flying: its thrust stays locked until" in warnings(server)
    if state is None:
        server.remove(vehicle.uri)
        assert "it is not known whether the vehicle flies: it is left as it is" in warnings(server)
    assert commands(vehicle) == []


def test_the_log_tells_that_an_old_vehicle_is_on_the_ground(server):
    vehicle = make_old_vehicle(server, READY)
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    assert commands(vehicle) == UNLOCKED
    server.remove(vehicle.uri)
    assert commands(vehicle) == 2 * UNLOCKED


def test_an_old_vehicle_that_flies_lands_before_its_motors_are_stopped(server):
    vehicle = make_old_vehicle(server, FLYING)
    server.add(vehicle.uri)
    wait_for_words(server, "flying")
    stream_position(server, vehicle)
    removing = begin_removing(server, vehicle)
    is_(vehicle, HIGH_LEVEL)
    # The landing takes its time, in which the state is looked up again and again.
    count = len(vehicle.packets(15, 0))
    vehicle.wait_for_packets(15, 0, count + 10)
    assert commands(vehicle) == [(7, 1), (8, 0)]
    is_(vehicle, READY)
    removing.join(LIMIT)
    assert commands(vehicle) == [(7, 1), (8, 0), *UNLOCKED]


def test_a_link_that_is_set_up_again_sends_an_old_vehicle_in_the_air_nothing(server):
    vehicle = make_old_vehicle(server, READY)
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    wait_for_words(server, "ready")
    vehicle.is_frozen = True
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    # Another node makes it fly.
    is_(vehicle, FLYING)
    vehicle.received.clear()
    vehicle.is_frozen = False
    wait_for_words(server, "flying")
    wait_until(lambda: "may be flying" in warnings(server), "the warning")
    assert vehicle.packets(3, 0) == []


def test_the_state_from_before_a_loss_is_forgotten(server):
    vehicle = make_old_vehicle(server, READY)
    server.add(vehicle.uri)
    log = server.node._vehicles[vehicle.uri].log
    wait_until(lambda: log.supervisor is not None, "the logged state")
    vehicle.is_frozen = True
    wait_for_words(server, "lost")
    assert log.supervisor is None


@pytest.mark.parametrize("protocol", [OLD, 12])
def test_a_vehicle_in_the_air_flies_on_when_it_is_added(server, protocol):
    with virtual_vehicle(protocol=protocol) as (virtual, uri):
        height = lambda: virtual.observe().position[2]  # noqa: E731
        with Crazyflie(uri) as other:
            other.high_level.take_off(0.5, 1.0)
            wait_until(lambda: height() > 0.45, "the takeoff")
        server.add(uri)
        end = virtual.vehicle.time + 2.5
        wait_until(lambda: virtual.vehicle.time >= end, "2.5 s of the vehicle's time")
        assert height() > 0.45
        assert SupervisorState.LOCKED not in virtual.vehicle.board.firmware.supervisor.flags


def test_the_first_zero_of_a_user_unlocks_what_nothing_is_known_of(server):
    """The driver passes it on as it comes, and the firmware opens its thrust lock at it."""
    vehicle = make_old_vehicle(server)
    server.add(vehicle.uri)
    thrust(server, 0.0)
    # Roll, pitch, yaw rate, then thrust.
    assert [data[12:] for data in vehicle.wait_for_packets(3, 0)] == [b"\0\0"]


def test_the_end_of_the_server_is_a_landing_for_an_old_vehicle(server):
    """Log data that are old would have the motors stopped."""
    vehicle = make_old_vehicle(server, FLYING)
    server.add(vehicle.uri)
    wait_for_words(server, "flying")
    stream_position(server, vehicle)

    def obey():
        vehicle.wait_for_packets(8, 0)
        is_(vehicle, HIGH_LEVEL)

    threading.Thread(target=obey, daemon=True).start()
    server.process.shut_down({"/crazyflie_server": server.node})
    assert commands(vehicle) == [(7, 1), (8, 0)]


def test_a_link_that_is_set_up_again_while_services_are_announced(server, monkeypatch):
    """The vehicle may have been restarted meanwhile, and its thrust be locked again."""
    vehicle = server.make_vehicle()
    advertise = VehicleServices.advertise

    def advertise_late(services):
        crazyflie = services._vehicle.crazyflie
        vehicle.is_frozen = True
        wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
        vehicle.received.clear()
        vehicle.is_frozen = False
        wait_until(lambda: crazyflie.state is LinkState.CONNECTED, "the new link")
        advertise(services)

    monkeypatch.setattr(VehicleServices, "advertise", advertise_late)
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    assert commands(vehicle) == UNLOCKED


def test_the_groups_of_a_vehicle_are_set_again_on_a_new_link(server):
    """Its battery was changed: the firmware has begun without groups, and ignored commands."""
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    server.call("/cf1/set_group_mask", SetGroupMaskRequest(5))
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    vehicle.is_frozen = True
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    crazyflie.high_level.forget_trajectories()
    vehicle.received.clear()
    vehicle.is_frozen = False
    assert vehicle.wait_for_packets(8, 0)[0] == b"\x00\x05"
    wait_until(lambda: crazyflie.high_level.is_addressed(4), "the groups")


def test_a_link_that_is_silent_while_it_is_taken_up_is_taken_up_when_it_is_heard(
    server, monkeypatch
):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    lost, is_lost = ParameterMirror.lost, threading.Event()

    def lose_link(_):
        monkeypatch.setattr(ParameterMirror, "lost", lost)
        vehicle.is_frozen = True
        wait_until(lambda: crazyflie.state is LinkState.LOST, "the silence")
        vehicle.received.clear()
        is_lost.set()
        vehicle.is_frozen = False
        raise LinkLostError("no link to the vehicle")

    monkeypatch.setattr(ParameterMirror, "lost", lose_link)
    vehicle.is_frozen = True
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    vehicle.is_frozen = False
    assert is_lost.wait(LIMIT)
    vehicle.wait_for_packets(7, 1)
    assert crazyflie.connection_count == 2
    assert commands(vehicle) == UNLOCKED


def test_a_new_link_is_taken_up_without_the_master(server, monkeypatch):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_parameters=True)
    transport = server.process.transport
    monkeypatch.setattr(transport, "set_param", Mock(side_effect=ConnectionRefusedError))
    later = Mock(side_effect=lambda *_: Future())
    monkeypatch.setattr(transport, "set_param_later", later)
    monkeypatch.setattr("crazyflie_driver.services.MASTER_LIMIT", 0.1)
    wait_for_words(server, "ready")
    vehicle.is_frozen = True
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    vehicle.received.clear()
    vehicle.is_frozen = False
    vehicle.wait_for_packets(7, 1)
    assert commands(vehicle) == UNLOCKED
    # The next job has its turn.
    server.call("/cf1/takeoff", TAKEOFF)
    assert later.call_args_list


def test_a_parameter_that_is_refused_later_does_not_keep_the_thrust_locked(server):
    vehicle = server.make_vehicle()
    server.add(vehicle.uri, enable_parameters=True)
    server.process.transport.parameters["/cf1/ring/effect"] = 9
    server.call("/cf1/update_params", UpdateParamsRequest(["ring/effect"]))
    wait_for_words(server, "ready")
    vehicle.is_frozen = True
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    code, _, _ = vehicle.parameters["ring.effect"]
    vehicle.parameters["ring.effect"] = (code, 6, READ_ONLY)
    vehicle.received.clear()
    vehicle.is_frozen = False
    vehicle.wait_for_packets(3, 0, 100)
    text = "parameter ring.effect can only be read"
    assert any(text in line for line in server.process.logged("warn"))


WRITTEN = {
    "health.startPropTest": ("B", 0, 0),
    "motorPowerSet.enable": ("B", 0, 0),
    "ring.effect": ("B", 6, 0),
}


def change_battery(server, vehicle, state):
    """Take the vehicle's battery out, and find it in a state on the new link."""
    vehicle.is_frozen = True
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    wait_until(lambda: crazyflie._opening is not None, "a new attempt to connect")
    vehicle.parameters.update(WRITTEN)
    is_(vehicle, state)
    vehicle.received.clear()
    vehicle.is_frozen = False
    wait_until(lambda: crazyflie.state is LinkState.CONNECTED, "the new link")
    # A job after those of the new link.
    server.call("/cf1/set_group_mask", SetGroupMaskRequest(1))


@pytest.mark.parametrize(("state", "is_on_ground"), [(READY, True), (FLYING, False)])
def test_a_changed_battery_runs_no_motors_and_a_flight_gets_nothing(server, state, is_on_ground):
    vehicle = server.make_vehicle(parameters=dict(WRITTEN))
    is_(vehicle, READY)
    server.add(vehicle.uri, enable_parameters=True)
    names = [name.replace(".", "/") for name in WRITTEN]
    for name in names:
        server.process.transport.parameters[f"/cf1/{name}"] = 1
    server.call("/cf1/update_params", UpdateParamsRequest(names))
    assert len(vehicle.packets(2, 2)) == 3
    change_battery(server, vehicle, state)
    # The third parameter is written, and nothing else.
    assert vehicle.packets(2, 2) == ([b"\2\0\1"] if is_on_ground else [])
    text = "not written again, as the vehicle may be flying: ring.effect; call update_params"
    assert any(text in line for line in server.process.logged("warn")) is not is_on_ground
