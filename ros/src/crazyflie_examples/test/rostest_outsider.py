"""The example as seen by other nodes, in one process or in many."""

import math

import pytest
import rosgraph
import rospy
import rosservice

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_reports.flight_operator import ready_operator

LIMIT = 20.0
TOPICS = {
    "/ref": "crazyflie_msgs/PositionVelocityStateStamped",
    "/state": "crazyflie_msgs/PositionVelocityYawStateStamped",
    "/control/lqr": "crazyflie_msgs/ControlStamped",
    "/control/takeoff": "crazyflie_msgs/ControlStamped",
    "/control/final": "crazyflie_msgs/ControlStamped",
    "/in_flight": "std_msgs/Empty",
    "/tf": "tf2_msgs/TFMessage",
}


@pytest.fixture(scope="module")
def operator():
    """Return an operator in flight."""
    with ready_operator() as operator:
        operator.takeoff()
        yield operator


def test_documented_topics_and_services_are_there(operator):
    published, _, _ = rosgraph.Master("/test").getSystemState()
    assert {name for name, _ in published} >= set(TOPICS)
    types = dict(rosgraph.Master("/test").getTopicTypes())
    assert {name: types[name] for name in TOPICS} == TOPICS
    for service in ("/takeoff", "/land"):
        assert rosservice.get_service_type(service) == "std_srvs/Empty"


def test_parameters_are_under_the_nodes_names():
    assert rospy.get_param("/simulator/frames/robot") == "crazyflie"
    assert rospy.get_param("/lqr_controller/topics/reference") == "/ref"
    assert rospy.get_param("/takeoff_server/hover/z") == 1.0


def test_an_outside_reference_is_followed(operator):
    goal = PositionVelocityState(x=0.3, y=-0.2, z=1.2)

    def distance():
        return math.dist(operator.position, (goal.x, goal.y, goal.z))

    publisher = rospy.Publisher("/ref", PositionVelocityStateStamped, queue_size=1)
    for _ in range(int(LIMIT / 0.1)):
        publisher.publish(PositionVelocityStateStamped(state=goal))
        operator.hover(0.1)
        if distance() < 0.02:
            break
    assert distance() < 0.02
