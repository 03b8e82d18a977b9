"""Services that set a vehicle up, on the virtual vehicle."""

import math
import struct

import pytest
from genpy import Duration
from geometry_msgs.msg import Point
from safety_helpers import FLYING, is_
from std_msgs.msg import ColorRGBA
from std_srvs.srv import EmptyRequest

from crazyflie_driver.msg import TrajectoryCompressedSegment
from crazyflie_driver.srv import (
    GoToRequest,
    ParamStateRequest,
    SetLedColorRequest,
    SpiralRequest,
    UpdateParamsRequest,
    UploadCompressedTrajectoryRequest,
    WriteLighthouseRequest,
)
from crazyflie_link.testing import write_lighthouse_file
from crazyflie_utils import ServiceError
from crazyflie_virtual.firmware.planner import read_compressed
from crazyflie_virtual.testing import virtual_vehicle

SPIRAL = SpiralRequest(0, 1.5, 0.5, 1.0, 0.25, Duration(3), True, False)


@pytest.fixture(scope="module")
def virtual(shared):
    """Return a server and a virtual vehicle, which it has as cf9."""
    with virtual_vehicle() as (vehicle, uri):
        shared.add(uri, "cf9")
        yield shared, vehicle.vehicle
        shared.remove(uri)


def value(server, name, prefix="cf9"):
    (crazyflie,) = (
        vehicle.crazyflie
        for vehicle in server.node._vehicles.values()
        if vehicle.parameters.name == prefix
    )
    return crazyflie.parameters.read(name)


def test_the_color_of_the_led_ring(virtual):
    server, _ = virtual
    server.call("/cf9/set_led_color", SetLedColorRequest(ColorRGBA(1.0, 0.5, 0.0, 0.0)))
    names = ("solidRed", "solidGreen", "solidBlue", "effect")
    assert [value(server, f"ring.{name}") for name in names] == [255, 128, 0, 7]
    for wrong in (1.5, -0.1, math.nan):
        with pytest.raises(ServiceError, match="color: green is .*; expected 0 to 1"):
            server.call("/cf9/set_led_color", SetLedColorRequest(ColorRGBA(g=wrong)))


def test_the_color_of_color_led_decks(shared):
    with virtual_vehicle(color_leds=True) as (_, uri):
        shared.add(uri, "cf8")
        shared.call("/cf8/set_led_color", SetLedColorRequest(ColorRGBA(1.0, 0.5, 0.0, 0.0)))
        decks = ("colorLedBot", "colorLedTop")
        assert [value(shared, f"{deck}.wrgb8888", "cf8") for deck in decks] == [0xFF8000] * 2
        assert value(shared, "ring.solidRed", "cf8") == 20
        shared.remove(uri)


def test_stored_parameters(virtual):
    server, _ = virtual

    def state():
        found = server.call("/cf9/param_state", ParamStateRequest("ring/effect"))
        return found.isStored, found.defaultValue, found.storedValue

    is_stored, default, stored = state()
    assert (is_stored, default) == (False, 6.0)
    assert math.isnan(stored)
    server.call("/cf9/set_led_color", SetLedColorRequest())
    server.call("/cf9/store_params", UpdateParamsRequest(["ring/effect"]))
    assert state() == (True, 6.0, 7.0)
    server.call("/cf9/clear_params", UpdateParamsRequest(["ring.effect"]))
    assert not state()[0]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("ring/solidRed", "ring.solidRed is not a persistent parameter"),
        ("ring/none", "no parameter 'ring.none'"),
        ("effect", "'effect' is not a firmware parameter; expected GROUP/NAME"),
    ],
)
def test_what_cannot_be_stored(virtual, name, text):
    server, _ = virtual
    with pytest.raises(ServiceError, match=text):
        server.call("/cf9/store_params", UpdateParamsRequest(["ring/effect", name]))
    # Those before it are not stored, either.
    assert not server.call("/cf9/param_state", ParamStateRequest("ring/effect")).isStored


def test_recovery_from_a_crash(virtual):
    server, vehicle = virtual
    supervisor = vehicle.board.firmware.supervisor
    supervisor.is_crashed = True
    server.call("/cf9/recover", EmptyRequest())
    assert not supervisor.is_crashed


def base_stations(path, *numbers):
    return WriteLighthouseRequest(write_lighthouse_file(path, *numbers))


def test_base_stations_from_a_file(virtual, tmp_path):
    server, vehicle = virtual
    pages = vehicle.storage.lighthouse
    server.call("/cf9/write_lighthouse", base_stations(tmp_path / "two.yaml", 0, 3))
    assert struct.unpack_from("<3f", pages[3]) == (1.0, 2.0, 5.0)
    assert struct.unpack("<L?", pages[16 + 3][-5:]) == (1003, True)
    # Data of other stations are no longer valid.
    server.call("/cf9/write_lighthouse", base_stations(tmp_path / "one.yaml", 0))
    assert [pages[number][-1] for number in range(4)] == [1, 0, 0, 0]


def test_a_wrong_lighthouse_file(virtual, tmp_path):
    server, _ = virtual
    path = tmp_path / "wrong.yaml"
    for text in ("type: other", "[]", "a: [", ""):
        path.write_text(text)
        with pytest.raises(ServiceError, match="lighthouse file .*wrong.yaml"):
            server.call("/cf9/write_lighthouse", WriteLighthouseRequest(str(path)))
    with pytest.raises(ServiceError, match="none.yaml.*No such file"):
        server.call("/cf9/write_lighthouse", WriteLighthouseRequest(str(tmp_path / "none.yaml")))
    with pytest.raises(ServiceError, match="room for 4 base stations, 0 to 3, .* has number 4"):
        server.call("/cf9/write_lighthouse", base_stations(tmp_path / "five.yaml", 4))
    with pytest.raises(ServiceError, match="base station 16; expected 0 to 15"):
        server.call("/cf9/write_lighthouse", base_stations(tmp_path / "many.yaml", 16))


def test_base_stations_are_not_written_in_flight(flying, tmp_path):
    server, vehicle = flying
    is_(vehicle, FLYING)
    with pytest.raises(ServiceError, match="expected it on the ground"):
        server.call("/cf1/write_lighthouse", base_stations(tmp_path / "one.yaml", 0))
    assert vehicle.packets(4, 2) == []


def segment(duration=1.0, **axes):
    return TrajectoryCompressedSegment(duration=Duration.from_sec(duration), **axes)


def test_a_compressed_trajectory(virtual):
    server, vehicle = virtual
    segments = [segment(x=[0.5], z=[1.0, 1.0, 1.5], yaw=[1.0]), segment(2.0)]
    request = UploadCompressedTrajectoryRequest(3, 100, Point(0.0, 0.25, 1.0), 0.5, segments)
    server.call("/cf9/upload_compressed_trajectory", request)
    planner = vehicle.board.firmware.planner
    assert struct.unpack_from("<4h", planner.memory, 100) == (0, 250, 1000, 286)
    where, read = planner._place(3)
    pieces = read(bytes(planner.memory[where]))
    assert read is read_compressed
    assert [piece.duration for piece in pieces][:2] == [1.0, 2.0]


@pytest.mark.parametrize(
    ("segments", "text"),
    [
        ([], "trajectory 3 has no segments"),
        ([segment(x=[1.0, 2.0])], "segment 0: x has 2 control points; expected 0, 1, 3 or 7"),
        ([segment(), segment(70.0)], "segment 1: its duration is 70 s; expected 0.001 to 65.535 s"),
        ([segment(y=[40.0])], r"segment 0: y is 40 m; expected at most \+-32.767"),
        ([segment(yaw=[math.nan])], "segment 0: yaw is nan rad"),
        ([segment(x=[1.0] * 7)] * 300, "do not fit; the vehicle has 4096"),
    ],
)
def test_a_wrong_compressed_trajectory(virtual, segments, text):
    server, _ = virtual
    request = UploadCompressedTrajectoryRequest(3, 0, Point(), 0.0, segments)
    with pytest.raises(ServiceError, match=text):
        server.call("/cf9/upload_compressed_trajectory", request)


def test_a_spiral_and_a_linear_go_to(flying):
    server, vehicle = flying
    server.call("/cf1/spiral", SPIRAL)
    goal = GoToRequest(0, False, Point(1.0, 0.0, 1.0), 0.5, Duration(2))
    server.call("/cf1/go_to_linear", goal)
    assert vehicle.packets(8, 0) == [
        struct.pack("<4B5f", 11, 0, 1, 0, 1.5, 0.5, 1.0, 0.25, 3.0),
        struct.pack("<4B5f", 12, 0, 0, 1, 1.0, 0.0, 1.0, 0.5, 2.0),
    ]
    wrong = SpiralRequest(0, 7.0, 0.5, 1.0, 0.0, Duration(3), False, False)
    with pytest.raises(ServiceError, match="spiral: angle is 7 rad; expected -2 pi to 2 pi"):
        server.call("/cf1/spiral", wrong)
    wrong.angle, wrong.finalRadius = 1.0, -1.0
    with pytest.raises(ServiceError, match="spiral: radius is -1 m; expected at least 0"):
        server.call("/cf1/spiral", wrong)
