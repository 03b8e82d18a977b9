"""Setpoints of a trajectory, and the command that takes over at its end, on a fake process."""

from concurrent.futures import Future

import numpy as np
import pytest

from crazyflie_driver.msg import FullState
from crazyflie_mission_api.stream import SetpointStream
from crazyflie_mission_api.trajectories import duration, straight
from crazyflie_utils import ServiceError
from crazyflie_utils.testing import FakeProcess

PIECES = straight((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), seconds=2.0)
END = (1.0, 0.0, 1.0)


class Bench:
    """A stream, and a driver whose answers wait until they are given."""

    def __init__(self):
        self.process = FakeProcess()
        handle = self.process.handle("/mission")
        self.asked = []
        self.stream = SetpointStream(handle, "/cf1/cmd_full_state", "hall", self.send)

    def send(self, goal="command"):
        """Ask for a command, or for the one that holds a goal."""
        answer = Future()
        self.asked.append((goal, answer))
        return answer

    def fly(self):
        """Stream to the end of the trajectory."""
        self.stream.start(PIECES)
        self.process.advance(duration(PIECES) + 0.03)

    def answer(self, error=None):
        """Answer the latest request."""
        if error is None:
            self.asked[-1][1].set_result(None)
        else:
            self.asked[-1][1].set_exception(ServiceError(error))

    def setpoints(self, seconds):
        """Advance the time; return the setpoints of that time."""
        before = len(self.process.published("/cf1/cmd_full_state"))
        self.process.advance(seconds)
        return self.process.published("/cf1/cmd_full_state")[before:]


@pytest.fixture
def bench():
    """Return a vehicle whose trajectory has just ended."""
    made = Bench()
    made.fly()
    return made


def at_end(setpoints):
    """Return whether there are setpoints, and all rest at the end."""
    places = [(p.pose.position.x, p.pose.position.y, p.pose.position.z) for p in setpoints]
    speeds = [p.twist.linear.x for p in setpoints]
    return len(places) > 0 and np.allclose(places, END) and not any(speeds)


def test_setpoints_follow_the_trajectory():
    made = Bench()
    made.stream.start(PIECES)
    setpoints = made.setpoints(2.0)
    assert isinstance(setpoints[0], FullState)
    assert setpoints[0].header.frame_id == "hall"
    # 35 / 16 of the mean speed, in the middle.
    assert max(p.twist.linear.x for p in setpoints) == pytest.approx(35 / 32, rel=0.01)


def test_setpoints_go_on_until_the_command_is_accepted(bench):
    ((goal, _),) = bench.asked
    assert goal.position == pytest.approx(END)
    assert at_end(bench.setpoints(0.1))
    bench.answer()
    assert bench.setpoints(1.0) == []
    assert len(bench.asked) == 1
    assert bench.stream.fault == ""


def test_setpoints_go_on_where_the_command_fails(bench):
    bench.answer("the vehicle has not replied")
    assert bench.stream.fault == (
        "the trajectory has ended, and go_to has failed: the vehicle has not replied; "
        "setpoints go on at its end"
    )
    assert at_end(bench.setpoints(1.1))
    assert len(bench.asked) == 2
    bench.answer()
    assert bench.setpoints(1.0) == []
    assert bench.stream.fault == ""


def test_a_command_that_was_accepted_late_is_repeated(bench):
    # The driver passes setpoints on again 0.5 s after a command, and they take the vehicle back.
    assert at_end(bench.setpoints(0.6))
    bench.answer()
    assert len(bench.asked) == 2
    assert at_end(bench.setpoints(0.1))
    bench.answer()
    assert bench.setpoints(1.0) == []


def test_the_next_command_does_not_overtake_the_one_at_the_end(bench):
    outcome = bench.stream.hand_over(bench.send)
    assert len(bench.asked) == 1
    bench.answer()
    assert bench.asked[-1][0] == "command"
    assert not outcome.done()
    bench.answer()
    assert outcome.result(0.0) is None
    assert bench.setpoints(1.0) == []


def test_a_second_trajectory_is_not_ended_by_the_end_of_the_first(bench):
    bench.stream.start(PIECES)
    bench.answer()
    first = bench.setpoints(0.1)[0]
    assert first.pose.position.x == pytest.approx(0.0, abs=0.01)


def test_the_next_trajectory_ends_the_fault_of_the_last_one(bench):
    bench.answer("the vehicle has not replied")
    assert bench.stream.fault
    bench.stream.start(PIECES)
    assert len(bench.setpoints(0.1)) > 0
    assert bench.stream.fault == ""


def test_the_end_of_a_trajectory_is_no_fault_of_the_next_one(bench):
    bench.stream.start(PIECES)
    bench.answer("the vehicle has not replied")
    assert len(bench.setpoints(0.1)) > 0
    assert bench.stream.fault == ""


def test_a_command_that_fails_leaves_the_stream_alone():
    made = Bench()
    made.stream.start(PIECES)
    made.process.advance(1.0)
    outcome = made.stream.hand_over(made.send)
    made.answer("the battery is low")
    assert str(outcome.exception(0.0)) == "the battery is low"
    assert made.setpoints(0.1)[0].twist.linear.x > 1.0


def test_a_landing_is_tried_again_as_long_as_there_is_time(bench):
    bench.answer("no link")
    outcome = bench.stream.hand_over(bench.send, 2.5)
    for tries in (2, 3, 4, 5):
        assert not outcome.done()
        assert len(bench.asked) == tries
        bench.answer("no link")
        assert at_end(bench.setpoints(1.1))
    assert str(outcome.exception(0.0)) == "no link"


def test_nothing_is_repeated_where_nothing_is_streamed():
    made = Bench()
    outcome = made.stream.hand_over(made.send, 2.5)
    made.process.advance(1.0)
    made.answer()
    assert outcome.result(0.0) is None
    assert made.setpoints(1.0) == []
    assert len(made.asked) == 1


def test_an_emergency_ends_all(bench):
    bench.stream.stop()
    bench.answer("emergency stop")
    assert bench.setpoints(2.0) == []
    assert len(bench.asked) == 1
