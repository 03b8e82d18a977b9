"""Vehicles come, fly and go while the simulation runs."""

import pytest
import rosnode
import rospy
from std_srvs.srv import Empty

from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_tutorial_msgs.srv import RemoveVehicle, SpawnVehicle
from crazyflie_utils.testing import peer

LIMIT = 60.0


def call(name, service_type, *arguments):
    rospy.wait_for_service(name, LIMIT)
    return rospy.ServiceProxy(name, service_type)(*arguments)


def nodes_of(vehicle):
    return [name for name in rosnode.get_node_names() if name.startswith(f"/{vehicle}/")]


def state_of(vehicle):
    with peer.listening(f"/{vehicle}/state", PositionVelocityYawStateStamped) as states:
        state = states.next().state
        return state.x, state.y, state.z


@pytest.fixture(scope="module")
def second():
    """Return the name of a vehicle that was spawned."""
    return call("/spawn", SpawnVehicle, "", 2.0, 1.0).name


def test_the_first_one_is_there_and_can_be_removed():
    rospy.wait_for_service("/first/takeoff", LIMIT)
    assert state_of("first") == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
    call("/remove", RemoveVehicle, "first")
    assert nodes_of("first") == []
    with pytest.raises(rospy.ServiceException, match="no vehicle 'first' was spawned"):
        call("/remove", RemoveVehicle, "first")


def test_another_one_is_where_it_was_wanted(second):
    assert second == "crazyflie1"
    assert state_of(second) == pytest.approx((2.0, 1.0, 0.0), abs=0.01)
    with pytest.raises(rospy.ServiceException, match="the vehicle crazyflie1 exists already"):
        call("/spawn", SpawnVehicle, "crazyflie1", 0.0, 0.0)


def test_it_flies_while_a_third_one_comes_and_goes(second):
    takeoff = rospy.ServiceProxy(f"/{second}/takeoff", Empty)
    takeoff()
    assert call("/spawn", SpawnVehicle, "rpr_crazyflie", -1.0, 0.0).name == "rpr_crazyflie"
    assert state_of("rpr_crazyflie") == pytest.approx((-1.0, 0.0, 0.0), abs=0.01)
    call("/remove", RemoveVehicle, "rpr_crazyflie")
    assert nodes_of("rpr_crazyflie") == []
    assert state_of(second) == pytest.approx((2.0, 1.0, 1.0), abs=0.1)
