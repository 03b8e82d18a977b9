"""Flights by high-level commands, with a driver that only remembers."""

from concurrent.futures import Future
from pathlib import Path

import numpy as np
import pytest
from fake_driver import FakeDriver

from crazyflie_demo.flight_plan_nodes import HighLevelFlightNode, TrajectoryFlightNode
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.programs import wait_until

FIGURE8 = Path(__file__).parents[1] / "data" / "figure8.csv"
PREPARATION = ["update_params", "update_params"]


def launch(node, refused=None, **parameters):
    process = FakeProcess()
    process.driver = FakeDriver()
    process.driver.refused = refused or {}
    assert process.launch(process.driver, "/driver")
    assert process.launch(node, "/cf/flight", parameters)
    process.node = node
    wait_until(lambda: process.driver.names()[:2] == PREPARATION, "the parameter to be set")
    return process


def requests(process, name):
    return [request for _, called, request in process.driver.calls if called == name]


def times(process):
    return [time - 100.0 for time, _, _ in process.driver.calls]


def test_a_test_flight():
    process = launch(HighLevelFlightNode(), height=0.8, distance=1.2, duration=3.0)
    process.advance(30.0)
    assert process.driver.names() == [*PREPARATION, "takeoff", "go_to", "go_to", "land", "stop"]
    assert times(process) == pytest.approx([0.0, 0.0, 0.0, 3.5, 7.0, 10.5, 15.5])
    (takeoff,), (land,) = requests(process, "takeoff"), requests(process, "land")
    assert takeoff.height == pytest.approx(0.8)
    assert takeoff.duration.to_sec() == 3.0
    assert land.height == 0.0
    assert land.duration.to_sec() == 4.5
    there, back = requests(process, "go_to")
    assert there.relative and back.relative
    assert (there.goal.x, back.goal.x) == (1.2, -1.2)
    assert there.duration.to_sec() == 3.0
    assert process.exit_status == 0
    process.node.shutdown()
    assert process.driver.names().count("land") == 1


def test_the_high_level_commander_is_enabled_first():
    process = launch(HighLevelFlightNode())
    assert process.transport.parameters["/cf/commander/enHighLevel"] == 1
    assert [request.params for request in requests(process, "update_params")] == [
        [],
        ["commander/enHighLevel"],
    ]


def test_a_frozen_master_blocks_no_callback_and_ends_the_flight_before_takeoff(monkeypatch):
    process, is_set = FakeProcess(), Future()
    process.driver = FakeDriver()
    assert process.launch(process.driver, "/driver")
    monkeypatch.setattr(process.transport, "set_param_later", lambda *_: is_set)
    assert process.launch(HighLevelFlightNode(), "/cf/flight", {})
    process.advance(20.0)
    assert "/cf/commander/enHighLevel" in process.logged("error")[0]
    assert process.exit_status == 1
    is_set.set_result(None)
    process.advance(20.0)
    assert process.driver.names() == ["update_params"]


def test_a_trajectory():
    node = TrajectoryFlightNode()
    process = launch(node, file=str(FIGURE8), timescale=1.5, height=0.6)
    process.advance(60.0)
    assert process.driver.names() == [
        *PREPARATION,
        "upload_trajectory",
        "takeoff",
        "start_trajectory",
        "land",
        "stop",
    ]
    assert times(process)[-2] - times(process)[-3] == pytest.approx(15.5)
    (upload,), (start,) = (
        requests(process, "upload_trajectory"),
        requests(process, "start_trajectory"),
    )
    table = np.loadtxt(FIGURE8, delimiter=",", skiprows=1)
    for row, piece in zip(table, upload.pieces, strict=True):
        assert piece.duration.to_sec() == row[0]
        sent = [*piece.poly_x, *piece.poly_y, *piece.poly_z, *piece.poly_yaw]
        np.testing.assert_allclose(sent, row[1:])
    assert (upload.trajectoryId, upload.pieceOffset) == (0, 0)
    assert (start.timescale, start.reversed, start.relative) == (1.5, False, True)
    assert "15.0 s, up to 0.56 m/s and 0.44 m/s^2" in process.logged("info")[0]
    assert process.exit_status == 0


def test_ends_before_the_takeoff_when_a_preparation_fails():
    process = launch(TrajectoryFlightNode(), {"upload_trajectory": "no memory"}, file=str(FIGURE8))
    process.advance(30.0)
    assert process.driver.names() == [*PREPARATION, "upload_trajectory"]
    assert "/cf/upload_trajectory failed: no memory" in process.logged("error")[0]
    assert process.exit_status == 1
    process.node.shutdown()
    assert "land" not in process.driver.names()


@pytest.mark.parametrize("failing", ["takeoff", "go_to"])
def test_lands_when_something_fails_in_flight(failing):
    process = launch(HighLevelFlightNode(), {failing: "link lost"})
    process.advance(30.0)
    assert process.driver.names()[-1] == failing
    assert process.exit_status == 1
    # The process ends; this is what it then does.
    process.node.shutdown()
    assert process.driver.names()[-1] == "land"


def test_lands_when_it_is_ended_in_flight():
    process = launch(HighLevelFlightNode())
    process.advance(3.0)
    process.node.shutdown()
    assert process.driver.names()[-1] == "land"


def test_says_when_there_is_no_driver():
    process = FakeProcess()
    assert process.launch(HighLevelFlightNode(), "/cf/flight", {})
    assert "/cf/update_params failed: there is no service" in process.logged("error")[0]
    assert process.exit_status == 1


@pytest.mark.parametrize(
    ("node", "parameters", "reason"),
    [
        (HighLevelFlightNode, {"height": 0.0}, "/cf/flight/height"),
        (HighLevelFlightNode, {"duration": 0.0}, "/cf/flight/duration"),
        (TrajectoryFlightNode, {}, "/cf/flight/file is not set"),
        (TrajectoryFlightNode, {"file": "/nowhere.csv"}, "(/nowhere.csv: cannot be read"),
        (TrajectoryFlightNode, {"file": str(FIGURE8), "timescale": 0.0}, "/cf/flight/timescale"),
    ],
)
def test_a_bad_parameter_is_named(node, parameters, reason):
    process = FakeProcess()
    assert not process.launch(node(), "/cf/flight", parameters)
    assert reason in process.logged("error")[0]
