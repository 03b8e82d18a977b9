"""The clients, without a master: services and publishers are replaced, and their calls recorded."""

from unittest.mock import DEFAULT, Mock, call, patch

import pytest
import rospy

from clients import replace_vehicle, wanderer
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_tutorial_msgs.srv import SpawnVehicleResponse, VelocityResponse

STATE = PositionVelocityYawStateStamped()


def test_step_1_asks_at_every_tenth_state_and_flies_the_answer():
    ask = Mock(return_value=VelocityResponse(0.3, 0.2))
    velocities, speeds = Mock(), Mock()
    node = wanderer.Wanderer(ask, velocities, speeds)
    for _ in range(25):
        node.on_state(STATE)
    assert ask.call_args_list == [call(0.0, 0.4)] * 2
    twist = velocities.publish.call_args.args[0]
    assert (twist.linear.x, twist.angular.z) == (0.3, 0.2)
    speed = speeds.publish.call_args.args[0]
    assert (speed.name, speed.vel) == ("linear", 0.3)


def test_step_1_a_service_that_fails_moves_nothing():
    velocities = Mock()
    node = wanderer.Wanderer(Mock(side_effect=rospy.ServiceException("gone")), velocities, Mock())
    with patch.multiple("rospy", logwarn=DEFAULT, logwarn_throttle=DEFAULT) as warnings:
        for _ in range(10):
            node.on_state(STATE)
    assert velocities.publish.call_count == 0
    assert any(warning.called for warning in warnings.values())


def test_step_2_the_node_is_connected():
    names = ("init_node", "Publisher", "Subscriber", "ServiceProxy", "wait_for_service", "spin")
    with patch.multiple("rospy", **dict.fromkeys(names, DEFAULT)) as ros:
        ros["ServiceProxy"].return_value.return_value = VelocityResponse(0.1, 0.0)
        wanderer.main()
        topic, message_type, callback = ros["Subscriber"].call_args.args[:3]
        for _ in range(10):
            callback(STATE)
    assert (topic, message_type) == ("state", PositionVelocityYawStateStamped)
    assert ros["wait_for_service"].call_args.args[0] == "velocity"
    assert {each.args[0] for each in ros["Publisher"].call_args_list} == {"cmd_vel", "speed"}
    assert ros["Publisher"].return_value.publish.call_count == 2


@pytest.mark.parametrize("is_there", [True, False])
def test_step_3_replaces_a_vehicle_also_if_it_is_not_there(is_there):
    remove = Mock(side_effect=None if is_there else rospy.ServiceException("unknown"))
    spawn = Mock(return_value=SpawnVehicleResponse("new_1"))
    with patch("rospy.logwarn"):
        assert replace_vehicle.replace(remove, spawn, "old", "new", 2.0, 1.0) == "new_1"
    remove.assert_called_once_with("old")
    spawn.assert_called_once_with("new", 2.0, 1.0)


def test_step_4_says_what_is_missing():
    missing = Mock(side_effect=rospy.ROSException("no service spawn"))
    with (
        patch.multiple("rospy", init_node=DEFAULT, ServiceProxy=DEFAULT, wait_for_service=missing),
        pytest.raises(SystemExit) as error,
    ):
        replace_vehicle.main()
    assert "no service spawn" in str(error.value)
