"""The driver and crazyflie_controller in one namespace, on a real master, in either order."""

import contextlib
import os

import pytest
import rosgraph
import rospy
import rosservice
from std_srvs.srv import Empty

from crazyflie_driver.srv import AddCrazyflie, AddCrazyflieRequest, RemoveCrazyflie
from crazyflie_utils.testing.peer import LIMIT, wait_until
from crazyflie_utils.testing.programs import running
from crazyflie_virtual.testing import virtual_vehicle

CONTROLLERS = "std_srvs/Empty"
DRIVERS = {"takeoff": "crazyflie_driver/Takeoff", "land": "crazyflie_driver/Land"}

BOTH = """
<launch>
  <group ns="cf1">
    <include file="$(find crazyflie_driver)/launch/crazyflie_add.launch">
      <arg name="uri" value="{uri}" />
      <arg name="tf_prefix" value="cf1" />
    </include>
    <include file="$(find crazyflie_controller)/launch/crazyflie2.launch">
      <arg name="frame" value="cf" />
    </include>
  </group>
</launch>
"""


@pytest.fixture(scope="module")
def uri():
    with virtual_vehicle() as (_, uri):
        yield uri


@pytest.fixture(autouse=True)
def fresh():
    """Reset the parameters to those of a new master for each test."""
    yield
    with contextlib.suppress(KeyError):
        rospy.delete_param("/cf1")


def controller():
    return running(
        *("roslaunch", "crazyflie_controller", "crazyflie2.launch", "frame:=cf"),
        env={**os.environ, "ROS_NAMESPACE": "cf1"},
    )


def type_of(name):
    return rosservice.get_service_type(f"/cf1/{name}")


def add(uri):
    rospy.wait_for_service("/add_crazyflie", LIMIT)
    request = AddCrazyflieRequest(uri=uri, tf_prefix="cf1")
    rospy.ServiceProxy("/add_crazyflie", AddCrazyflie)(request)


def remove(uri):
    rospy.ServiceProxy("/remove_crazyflie", RemoveCrazyflie)(uri)


def check_that_the_driver_stands_aside():
    for name, service_type in DRIVERS.items():
        assert type_of(name) == CONTROLLERS
        assert type_of(f"driver/{name}") == service_type
    # Who answers is the controller.
    with pytest.raises(rospy.ServiceException, match="takeoff refused: .*no new pose"):
        rospy.ServiceProxy("/cf1/takeoff", Empty)()
    assert type_of("go_to") == "crazyflie_driver/GoTo"


def test_without_a_controller_the_driver_has_the_names(uri):
    add(uri)
    assert {name: type_of(name) for name in DRIVERS} == DRIVERS
    assert type_of("driver/takeoff") is None
    remove(uri)


# test_service_names.py has them in a fake process; both_are_in_a_launch_file remains.
@pytest.mark.long
def test_the_controller_comes_first(uri):
    with controller():
        rospy.wait_for_service("/cf1/land", LIMIT)
        add(uri)
        check_that_the_driver_stands_aside()
        remove(uri)
        assert {type_of(name) for name in DRIVERS} == {CONTROLLERS}
        services = rosgraph.Master(rospy.get_name()).getSystemState()[2]
        assert not [name for name, _ in services if name.startswith("/cf1/driver/")]


def test_both_are_in_a_launch_file(uri, tmp_path):
    path = tmp_path / "hover.launch"
    path.write_text(BOTH.format(uri=uri))
    with running("roslaunch", "--screen", path):
        rospy.wait_for_service("/cf1/driver/land", LIMIT)
        check_that_the_driver_stands_aside()
        remove(uri)


@pytest.mark.long
def test_the_controller_comes_later(uri):
    add(uri)
    assert type_of("takeoff") == DRIVERS["takeoff"]
    with controller():
        wait_until(
            lambda: {type_of(name) for name in DRIVERS} == {CONTROLLERS}, "the controller's names"
        )
        # Added again, the driver knows better.
        remove(uri)
        assert type_of("land") == CONTROLLERS
        add(uri)
        check_that_the_driver_stands_aside()
        remove(uri)
