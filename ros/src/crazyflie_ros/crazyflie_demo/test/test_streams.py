"""Flights by streams of setpoints, of a trajectory and of positions."""

from pathlib import Path

import numpy as np
import pytest
from fake_driver import FakeDriver

from crazyflie_demo.stream_nodes import PositionFlightNode, TrajectoryStreamNode
from crazyflie_demo.uav_trajectory import Trajectory
from crazyflie_utils.testing import FakeProcess

FIGURE8 = Path(__file__).parents[1] / "data" / "figure8.csv"


def launch(node, **parameters):
    process = FakeProcess()
    assert process.launch(node, "/cf/flight", parameters)
    return process


def test_a_trajectory_is_streamed_as_it_is():
    process = launch(TrajectoryStreamNode(str(FIGURE8)), topic="/cf/cmd_full_state")
    assert process.launch(FakeDriver(), "/driver")
    process.advance(12.0)
    assert process.exit_status == 0
    setpoints = process.published("/cf/cmd_full_state")
    assert len(setpoints) == pytest.approx(1001, abs=1)
    trajectory = Trajectory()
    trajectory.loadcsv(FIGURE8)
    for k, setpoint in list(enumerate(setpoints))[::50]:
        goal = trajectory.eval(min(k / 100.0, 10.0))
        p, v, a, w = (
            setpoint.pose.position,
            setpoint.twist.linear,
            setpoint.acc,
            setpoint.twist.angular,
        )
        sent = [[each.x, each.y, each.z] for each in (p, v, a, w)]
        expected = goal.pos, goal.vel, goal.acc, goal.omega
        np.testing.assert_allclose(sent, expected, atol=1e-6)
        assert setpoint.pose.orientation.w == 1.0
    assert setpoints[0].header.frame_id == "world"


def test_a_bad_file_ends_the_node():
    process = FakeProcess()
    assert not process.launch(TrajectoryStreamNode("/none.csv"), "/flight")
    assert "/none.csv: cannot be read" in process.logged("error")[0]


def test_begins_with_the_first_subscriber():
    process = FakeProcess()
    node = TrajectoryStreamNode(str(FIGURE8))
    assert process.launch(node, "/flight")
    node._publisher.has_subscribers = lambda: False
    process.advance(5.0)
    assert process.published("/crazyflie/cmd_full_state") == []
    node._publisher.has_subscribers = lambda: True
    process.advance(1.0)
    first = process.published("/crazyflie/cmd_full_state")[0]
    assert (first.pose.position.x, first.twist.linear.x) == (0.0, 0.0)


def test_positions_go_up_to_the_side_back_and_down():
    process = launch(PositionFlightNode(), x=1.0, height=0.5, distance=0.3, speed=0.25)
    process.advance(30.0)
    assert process.exit_status == 0
    places = np.array([[p.x, p.y, p.z] for p in process.published("/cf/cmd_position")])
    np.testing.assert_allclose(places[[0, -1]], [[1.0, 0.0, 0.0]] * 2, atol=1e-6)
    np.testing.assert_allclose(places.max(axis=0), [1.3, 0.3, 0.5], atol=1e-6)
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) * 50.0
    assert speeds.max() == pytest.approx(0.25, abs=1e-4)
    assert len(process.published("/cf/cmd_stop")) == 1


def test_a_trajectory_ends_with_a_landing():
    process = launch(TrajectoryStreamNode(str(FIGURE8)), topic="/cf/cmd_full_state")
    driver = FakeDriver()
    assert process.launch(driver, "/driver")
    process.advance(12.0)
    assert driver.names() == ["land"]
    assert process.exit_status == 0


def flown(refused):
    """Return a process at the end of a trajectory, and its driver."""
    process = launch(TrajectoryStreamNode(str(FIGURE8)), topic="/cf/cmd_full_state")
    driver = FakeDriver()
    driver.refused = refused
    assert process.launch(driver, "/driver")
    process.advance(10.1)
    return process, driver


def test_the_end_is_at_rest_whatever_the_file_says(tmp_path):
    file = tmp_path / "straight.csv"
    header = FIGURE8.read_text().splitlines()[0]
    file.write_text(f"{header}\n1.0,0,0.5{',0' * 30}\n")
    process = launch(TrajectoryStreamNode(str(file)))
    process.advance(2.0)
    setpoints = process.published("/crazyflie/cmd_full_state")
    last = setpoints[-1]
    assert [setpoints[50].twist.linear.x, last.twist.linear.x] == [0.5, 0.0]
    assert last.pose.position.x == pytest.approx(0.5)


def test_setpoints_go_on_until_the_landing_is_accepted():
    process, driver = flown({"land": "no reply"})
    before = len(process.published("/cf/cmd_full_state"))
    process.advance(0.9)
    at_the_end = process.published("/cf/cmd_full_state")[before:]
    assert len(at_the_end) == pytest.approx(90, abs=1)
    assert {each.twist.linear.x for each in at_the_end} == {0.0}
    assert process.exit_status is None
    driver.refused = {}
    process.advance(0.2)
    assert driver.names() == ["land", "land"]
    assert process.exit_status == 0
    count = len(process.published("/cf/cmd_full_state"))
    process.advance(1.0)
    assert len(process.published("/cf/cmd_full_state")) == count


def test_a_landing_that_is_not_carried_out_is_an_error():
    process, _ = flown({"land": "no reply"})
    process.advance(9.0)
    assert process.exit_status is None
    process.advance(3.0)
    assert process.exit_status == 1
    assert process.logged("error") == [
        "/cf/flight: MAY STILL FLY: the landing has failed for 10 s: no reply"
    ]


def test_a_landing_that_was_accepted_late_is_repeated():
    process, driver = flown({"land": None})
    # The driver passes setpoints on again 0.5 s after a command.
    process.advance(0.5)
    driver.refused = {}
    driver.answer()
    process.advance(0.1)
    assert driver.names() == ["land", "land"]
    assert process.exit_status == 0


@pytest.mark.parametrize(("after", "calls"), [(2.0, ["land"]), (30.0, [])])
def test_lands_when_it_is_interrupted(after, calls):
    process = launch(PositionFlightNode())
    driver = FakeDriver()
    assert process.launch(driver, "/driver")
    node = PositionFlightNode()
    assert process.launch(node, "/cf/second")
    process.advance(after)
    node.shutdown()
    assert driver.names() == calls
