"""How long the caller of a service waits."""

import itertools
from concurrent.futures import Future

import pytest

from crazyflie_utils import ServiceError
from crazyflie_utils.runtime import ros_transport
from crazyflie_utils.runtime.ros_transport import wait_for_answer


def test_an_answer_is_returned():
    answer = Future()
    answer.set_result("yes")
    assert wait_for_answer(answer, "/go", lambda: 0.0) == "yes"


def test_a_refusal_is_passed_on():
    answer = Future()
    answer.set_exception(ServiceError("not now"))
    with pytest.raises(ServiceError, match="^not now$"):
        wait_for_answer(answer, "/go", lambda: 0.0)


def test_caller_is_not_left_waiting_at_shutdown(monkeypatch):
    monkeypatch.setattr("rospy.core.is_shutdown_requested", lambda: True)
    with pytest.raises(ServiceError, match="/go: the node is shutting down"):
        wait_for_answer(Future(), "/go", itertools.count().__next__)


def test_caller_is_not_left_waiting_by_a_clock_that_stands_still(monkeypatch):
    monkeypatch.setattr(ros_transport, "_STALL_LIMIT", 0.05)
    with pytest.raises(ServiceError, match="/go: /clock stands still"):
        wait_for_answer(Future(), "/go", lambda: 7.0)
