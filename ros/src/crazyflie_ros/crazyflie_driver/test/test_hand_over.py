"""A flight on setpoints goes on when a high-level command cannot be carried out."""

import copy
import math
import struct
from dataclasses import replace

import pytest
from genpy import Duration
from geometry_msgs.msg import Point
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safety_helpers import (
    FLYING,
    HIGH_LEVEL,
    LAND,
    SETPOINTS_STOP,
    TAKEOFF,
    is_,
    position,
    stream_position,
    wait_for_words,
)

from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import (
    GoToRequest,
    LandRequest,
    NotifySetpointsStopRequest,
    SetGroupMaskRequest,
    StartTrajectoryRequest,
    StopRequest,
    TakeoffRequest,
    UploadTrajectoryRequest,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.firmware.setpoints import PRIORITY_CRTP

GROUPS, KNOWN_TRAJECTORY = 0b0101, 7


@pytest.fixture(scope="module")
def streaming(shared):
    """Return a server and a vehicle with groups and a trajectory, for all tests."""
    (vehicle,) = shared.vehicles
    shared.call("/cf1/set_group_mask", SetGroupMaskRequest(GROUPS))
    piece = TrajectoryPolynomialPiece(duration=Duration(1))
    upload = UploadTrajectoryRequest(KNOWN_TRAJECTORY, 0, [piece])
    shared.call("/cf1/upload_trajectory", upload)
    is_(vehicle, FLYING)
    wait_for_words(shared, "flying")
    return shared, vehicle


@pytest.fixture
def flight(streaming):
    begin(*streaming)
    return streaming


def begin(server, vehicle):
    """Fly the vehicle on positions, without earlier packets."""
    vehicle.answers.clear()
    vehicle.deaf.clear()
    is_(vehicle, FLYING)
    server.process.advance(1.0)
    vehicle.received.clear()
    stream_position(server, vehicle)


def assert_flies_on(server, vehicle):
    """Assert that the stream was not ended, and passes at once."""
    assert vehicle.packets(7, 1) == []
    position(server)
    vehicle.wait_for_packets(7, 0)
    assert vehicle.packets(7, 1) == []


nonsense = st.sampled_from([math.nan, math.inf, -math.inf])
wide_nonsense = nonsense | st.sampled_from([1e39, -1e300])
numbers = st.floats(-3.0, 3.0, width=32)
not_positive = st.builds(
    Duration, st.integers(-(2**31), -1), st.integers(0, 999_999_999)
) | st.just(Duration(0))
durations = st.builds(Duration, st.integers(1, 100))


def one_is_wrong(make, right, wrong):
    """Return requests in which at least one argument is wrong."""
    return st.sampled_from(range(len(right))).flatmap(
        lambda bad: st.builds(
            make, *[wrong[k] if k == bad else right[k] | wrong[k] for k in range(len(right))]
        )
    )


def go_to(x, y, z, yaw, duration):
    return "go_to", GoToRequest(0, False, Point(x, y, z), yaw, duration)


ILLEGAL = st.one_of(
    one_is_wrong(
        lambda height, duration: ("takeoff", TakeoffRequest(0, height, duration)),
        [numbers, durations],
        [nonsense, not_positive],
    ),
    one_is_wrong(
        lambda height, duration: ("land", LandRequest(0, height, duration)),
        [numbers, durations],
        [nonsense, not_positive],
    ),
    one_is_wrong(
        go_to, [numbers] * 4 + [durations], [wide_nonsense] * 3 + [nonsense, not_positive]
    ),
    one_is_wrong(
        lambda number, scale: (
            "start_trajectory",
            StartTrajectoryRequest(0, number, scale, False, False),
        ),
        [st.just(KNOWN_TRAJECTORY), st.floats(0.5, 2.0, width=32)],
        [st.integers(0, 255).filter(lambda k: k != KNOWN_TRAJECTORY), nonsense | st.just(0.0)],
    ),
)


@settings(
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(call=ILLEGAL)
def test_what_cannot_be_flown_leaves_the_stream_alone(streaming, call):
    server, vehicle = streaming
    begin(server, vehicle)
    name, request = call
    with pytest.raises(ServiceError):
        server.call(f"/cf1/{name}", request)
    assert vehicle.packets(8, 0) == []
    assert_flies_on(server, vehicle)


@given(
    call=st.sampled_from(
        [
            ("takeoff", TAKEOFF),
            ("land", LAND),
            ("stop", StopRequest()),
            ("go_to", GoToRequest(duration=Duration(1))),
            ("start_trajectory", StartTrajectoryRequest(0, KNOWN_TRAJECTORY, 1.0, False, False)),
        ]
    ),
    mask=st.integers(1, 255).filter(lambda mask: not mask & GROUPS),
)
@settings(
    deadline=None,
    max_examples=10,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_commands_for_other_groups_leave_the_stream_alone(streaming, call, mask):
    """The firmware answers "done" and ignores them: the vehicle would fall."""
    server, vehicle = streaming
    begin(server, vehicle)
    name, request = call
    request = copy.copy(request)
    request.groupMask = mask
    server.call(f"/cf1/{name}", request)
    assert len(vehicle.packets(8, 0)) == 1
    assert_flies_on(server, vehicle)


def test_a_landing_vehicle_whose_groups_another_client_has_changed_goes_on_landing(flight):
    server, vehicle = flight
    vehicle.answers[8, 0, 8] = b"\x08\x00\x00\x01"
    server.call("/cf1/land", LandRequest(0xFF & ~GROUPS, 0.0, Duration(2)))
    assert len(vehicle.packets(8, 0)) == 1


def test_commands_for_some_groups_are_refused_where_those_of_the_vehicle_are_not_known(hovering):
    server, vehicle = hovering
    with pytest.raises(ServiceError, match="Call set_group_mask first"):
        server.call("/cf1/land", LandRequest(1, 0.0, Duration(2)))
    assert_flies_on(server, vehicle)
    server.call("/cf1/set_group_mask", SetGroupMaskRequest(3))
    server.call("/cf1/land", LandRequest(1, 0.0, Duration(2)))
    assert vehicle.packets(7, 1) == [SETPOINTS_STOP]


def test_a_takeoff_with_a_low_battery(flight):
    server, vehicle = flight
    vehicle.log["pm.vbat"] = ("f", 3.1)
    battery = server.node._vehicles[vehicle.uri].log.battery
    wait_until(battery.words, "the low voltage")
    with pytest.raises(ServiceError, match="battery low"):
        server.call("/cf1/takeoff", TAKEOFF)
    assert_flies_on(server, vehicle)
    vehicle.log["pm.vbat"] = ("f", 3.9)
    wait_until(lambda: not battery.words(), "the voltage")


@pytest.mark.parametrize(
    ("name", "request_"), [("takeoff", TAKEOFF), ("go_to", GoToRequest(duration=Duration(1)))]
)
def test_a_vehicle_that_cannot_fly(flight, name, request_):
    server, vehicle = flight
    is_(vehicle, 0x252)
    driven = server.node._vehicles[vehicle.uri]
    wait_until(lambda: driven.log.supervisor == 0x252, "the state")
    with pytest.raises(ServiceError, match="cannot fly, its state is: armed, flying, locked"):
        server.call(f"/cf1/{name}", request_)
    assert_flies_on(server, vehicle)
    is_(vehicle, FLYING)
    wait_until(lambda: driven.log.supervisor == FLYING, "the state")


@pytest.mark.parametrize("answer", [b"\x08\x00\x00\x10", None])
def test_setpoints_take_over_again_after_a_command_that_fails(flight, answer):
    server, vehicle = flight
    if answer is None:
        vehicle.deaf.add((8, 0, b""))
    else:
        vehicle.answers[8, 0, 8] = answer
    with pytest.raises(ServiceError):
        server.call("/cf1/land", LAND)
    position(server)
    vehicle.wait_for_packets(7, 0)
    # It was right before the command, and with it.
    assert [(p, c) for p, c, _ in vehicle.received if p in (7, 8)][:2] == [(7, 1), (8, 0)]


def test_a_command_that_is_carried_out_keeps_setpoints_under_way_out(flight):
    server, vehicle = flight
    server.call("/cf1/land", LAND)
    position(server)
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert vehicle.packets(7, 0) == []
    assert vehicle.packets(7, 1) == [struct.pack("<BI", 0, 0)]


@pytest.mark.parametrize(
    ("name", "request_"), [("land", LAND), ("go_to", GoToRequest(duration=Duration(1)))]
)
def test_a_notice_that_is_lost_is_sent_again_with_the_next_command(flight, name, request_):
    """The vehicle accepts the command, and does not fly by it until setpoints stop."""
    server, vehicle = flight
    vehicle.deaf.add((7, 1, b""))
    server.call("/cf1/land", LAND)
    assert vehicle.flight.commander.priority == PRIORITY_CRTP
    vehicle.deaf.clear()
    is_(vehicle, HIGH_LEVEL)
    server.process.advance(0.5)
    server.call(f"/cf1/{name}", request_)
    assert [(p, c) for p, c, _ in vehicle.received if p in (7, 8)] == 2 * [(7, 1), (8, 0)]
    assert vehicle.flight.commander.priority < PRIORITY_CRTP
    # By then a vehicle that has not received it is locked.
    server.process.advance(2.0)
    server.call("/cf1/go_to", GoToRequest(duration=Duration(1)))
    assert len(vehicle.packets(7, 1)) == 2


def test_a_notice_by_radio_which_acknowledges_it_is_sent_once(flight, monkeypatch):
    server, vehicle = flight
    crazyflie = server.node._vehicles[vehicle.uri].crazyflie
    monkeypatch.setattr(crazyflie, "address", replace(crazyflie.address, scheme="radio"))
    server.call("/cf1/land", LAND)
    is_(vehicle, HIGH_LEVEL)
    server.process.advance(0.5)
    server.call("/cf1/go_to", GoToRequest(duration=Duration(1)))
    assert len(vehicle.packets(7, 1)) == 1


def test_a_notice_is_kept_where_the_log_does_not_tell_whether_the_vehicle_flies(server):
    vehicle = server.make_vehicle()
    del vehicle.log["supervisor.info"]
    server.add(vehicle.uri)
    vehicle.wait_for_packets(7, 1)
    vehicle.received.clear()
    position(server)
    vehicle.wait_for_packets(7, 0)
    server.call("/cf1/notify_setpoints_stop", NotifySetpointsStopRequest(0, 0))
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 2)
    assert vehicle.packets(7, 1) == []
