"""Two vehicles by remapped topics, with a planner and a safety filter as labs have them."""

import math

import pytest
import rospy
from std_srvs.srv import Empty

from crazyflie_msgs.msg import (
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
    PrioritizedControlStamped,
)
from crazyflie_utils.testing.programs import LIMIT, wait_until

VEHICLES = ("HY4", "HY5")
GOAL = (1.0, 0.0, 1.2)


@pytest.fixture(scope="module")
def states():
    """Return the states of each vehicle, which grow."""
    found = {name: [] for name in VEHICLES}
    for name, states in found.items():
        rospy.Subscriber(
            f"/state{name}",
            PositionVelocityYawStateStamped,
            lambda message, states=states: states.append(message.state),
        )
    return found


def call(name):
    rospy.wait_for_service(name, LIMIT)
    rospy.ServiceProxy(name, Empty)()


def distance(state, goal):
    return math.dist((state.x, state.y, state.z), goal)


@pytest.fixture(scope="module")
def priorities(states):
    """Fly both vehicles; return the priorities of the planner's controls."""
    seen = []
    rospy.Subscriber(
        "/control/plannerHY4",
        PrioritizedControlStamped,
        lambda message: seen.append(message.control.priority),
    )
    beyond = rospy.Publisher("/refHY5", PositionVelocityStateStamped, latch=True, queue_size=1)
    for name in VEHICLES:
        call(f"/takeoff{name}")
    reference = PositionVelocityStateStamped()
    reference.header.stamp = rospy.Time.now()
    reference.state.x, reference.state.y, reference.state.z = 1.5, 2.0, 1.0
    beyond.publish(reference)
    wait_until(lambda: distance(states["HY4"][-1], GOAL) < 0.25, "the planner's goal", LIMIT)
    wait_until(lambda: states["HY5"][-1].x > 0.45, "the wall", LIMIT)
    end = rospy.get_time() + 3.0
    wait_until(lambda: rospy.get_time() > end, "a moment of hover", LIMIT)
    return seen


def test_the_planner_overrides_beyond_its_bound_and_leads_to_its_goal(states, priorities):
    assert {0.0, 1.0} == set(priorities)
    assert distance(states["HY4"][-1], GOAL) < 0.25


def test_the_filter_holds_the_vehicle_at_the_wall(states, priorities):
    assert max(state.x for state in states["HY5"]) < 0.55
    assert distance(states["HY5"][-1], (0.5, 2.0, 1.0)) < 0.1


def test_each_lands_by_its_own_service(states, priorities):
    call("/landHY5")
    wait_until(lambda: states["HY5"][-1].z == 0.0, "the ground", LIMIT)
    assert states["HY4"][-1].z > 0.9
    call("/landHY4")
    wait_until(lambda: states["HY4"][-1].z == 0.0, "the ground", LIMIT)
