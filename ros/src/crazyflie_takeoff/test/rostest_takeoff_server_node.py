"""The takeoff server in a process of its own, on a real master."""

import contextlib
from concurrent.futures import ThreadPoolExecutor

import pytest
import rospy
from std_msgs.msg import Empty
from std_srvs.srv import Empty as EmptyService
from takeoff_helpers import text_of

from crazyflie_msgs.msg import ControlStamped, FlightStatus, PositionVelocityStateStamped
from crazyflie_utils.testing.peer import LIMIT, listening


@pytest.fixture(scope="module")
def heard():
    """Return a queue of what is said on each topic."""
    topics = {
        "/in_flight_flight_status": FlightStatus,
        "/in_flight": Empty,
        "/control/takeoff": ControlStamped,
    }
    with contextlib.ExitStack() as stack:
        yield {topic: stack.enter_context(listening(topic, kind)) for topic, kind in topics.items()}


def service(name):
    rospy.wait_for_service(name, timeout=LIMIT)
    return rospy.ServiceProxy(name, EmptyService)


def refusal(name):
    with pytest.raises(rospy.ServiceException) as error:
        service(name)()
    return str(error.value)


def wait_for_state(heard, state):
    heard["/in_flight_flight_status"].next(lambda status: text_of(status) == state)


def thrusts(heard):
    """Return what has been said since the last time."""
    return [message.control.thrust for message in heard["/control/takeoff"].drain()]


def test_takes_off_and_lands_and_says_why_it_refuses(heard):
    wait_for_state(heard, "on_ground")
    assert heard["/control/takeoff"].next().control.thrust == 0.0
    assert "/land refused: the vehicle is on the ground" in refusal("/land")

    with ThreadPoolExecutor() as threads:
        takeoff = threads.submit(service("/takeoff"))
        wait_for_state(heard, "taking_off")
        assert "/takeoff refused: a takeoff is under way" in refusal("/takeoff")
        takeoff.result(timeout=LIMIT)
    heard["/in_flight"].next()
    said = thrusts(heard)
    lift_off = said.index(pytest.approx(10.01))
    assert set(said[:lift_off]) <= {0.0}
    assert said[lift_off:] == pytest.approx([10.01] * len(said[lift_off:]))
    assert "/takeoff refused: the vehicle is in flight" in refusal("/takeoff")

    # Who comes late is told the reference.
    message = rospy.wait_for_message("/ref", PositionVelocityStateStamped, timeout=LIMIT)
    assert (message.state.x, message.state.y, message.state.z) == (0.0, 0.5, 1.0)

    service("/land")()
    heard["/in_flight"].next()
    wait_for_state(heard, "on_ground")
    ramp = []
    while not ramp or ramp[-1] != 0.0:
        ramp.append(heard["/control/takeoff"].next().control.thrust)
    assert ramp[0] == pytest.approx(9.81)
    assert ramp == sorted(ramp, reverse=True)
    assert len(ramp) > 10
    assert ramp[-2] > 4.8
    assert "/land refused: the vehicle is on the ground" in refusal("/land")
