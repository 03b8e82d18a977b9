"""The takeoff control filter in a process of its own, on a real master."""

import pytest
import rospy
from std_msgs.msg import Empty
from std_srvs.srv import Empty as EmptyService

from crazyflie_msgs.msg import Control, ControlStamped, FilterStatus
from crazyflie_takeoff.takeoff_control_filter_node import status_text
from crazyflie_utils.testing.peer import LIMIT, listening, wait_until


@pytest.fixture(scope="module")
def final():
    """Return a queue of what is passed on."""
    with listening("/control/final", ControlStamped) as final:
        yield final


@pytest.fixture(scope="module")
def say():
    """Return a function that publishes on a topic that the filter hears."""
    types = {
        "/control/takeoff": ControlStamped,
        "/control/lqr": ControlStamped,
        "/in_flight": Empty,
    }
    publishers = {
        topic: rospy.Publisher(topic, kind, queue_size=10) for topic, kind in types.items()
    }
    wait_until(
        lambda: all(publisher.get_num_connections() for publisher in publishers.values()),
        "the filter to listen",
    )
    return lambda topic, message: publishers[topic].publish(message)


def control(thrust):
    return ControlStamped(control=Control(thrust=thrust))


def has_thrust(value):
    return lambda message: message.control.thrust == value


def say_until_heard(say, topic, value, final):
    """Publish a control again and again until it is passed on."""

    def is_passed_on():
        say(topic, control(value))
        return any(map(has_thrust(value), final.drain()))

    wait_until(is_passed_on, f"{value} on {topic} to be passed on")


def test_passes_the_right_control(say, final):
    # There was no message yet: the controller has the vehicle.
    say_until_heard(say, "/control/lqr", 1.0, final)
    say_until_heard(say, "/control/takeoff", 2.0, final)
    # The takeoff control gets old.
    say_until_heard(say, "/control/lqr", 3.0, final)

    # In flight the controller must not be silent.
    stream = rospy.Timer(rospy.Duration(0.02), lambda _: say("/control/lqr", control(3.0)))
    with listening("/in_flight_filter_status", FilterStatus) as memory:
        assert status_text(memory.next()) in ("unknown", "commanded")
        say("/in_flight", Empty())
        memory.next(lambda status: status_text(status) == "flying")
    # In flight every control is passed on, whatever the age of the other kind.
    for value in range(5, 15):
        say("/control/takeoff", control(value))
        final.next(has_thrust(value))
        say("/control/lqr", control(value + 0.5))
        final.next(has_thrust(value + 0.5))
    stream.shutdown()
    with listening("/in_flight_filter_status", FilterStatus) as memory:
        memory.next(lambda status: "sinking from flying: no control" in status_text(status))
        memory.next(lambda status: status.state == FilterStatus.DOWN)
    final.next(has_thrust(0.0))
    rospy.wait_for_service("/emergency_reset", LIMIT)
    with pytest.raises(rospy.ServiceException, match="there is no emergency"):
        rospy.ServiceProxy("/emergency_reset", EmptyService)()
    rospy.ServiceProxy("/emergency", EmptyService)()
    with listening("/in_flight_filter_status", FilterStatus) as memory:
        memory.next(lambda status: status.reason.endswith("/emergency was called"))
