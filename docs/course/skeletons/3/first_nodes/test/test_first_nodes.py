"""The first nodes, without a master: rospy's functions are replaced, and their calls recorded."""

from pathlib import Path
from unittest.mock import DEFAULT, patch

import pytest

from crazyflie_msgs.msg import PositionVelocityYawState, PositionVelocityYawStateStamped
from crazyflie_utils.testing.launch_files import expand
from first_nodes import highest, settings

PACKAGE = Path(__file__).resolve().parents[1]


def state(z):
    """Return the message of a vehicle at a height, m."""
    return PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=z))


def test_step_1_logs_the_greatest_height_and_no_other():
    node = highest.Highest()
    with patch("rospy.loginfo") as loginfo:
        for z in (0.05, 0.5, 0.55, 0.3, 1.0):
            node.on_state(state(z))
    assert loginfo.call_count == 2
    assert node.height == 1.0


def test_step_2_subscribes_and_spins():
    with patch.multiple("rospy", init_node=DEFAULT, Subscriber=DEFAULT, spin=DEFAULT) as rospy:
        highest.main()
    topic, message_type, callback = rospy["Subscriber"].call_args.args[:3]
    assert (topic, message_type) == ("state", PositionVelocityYawStateStamped)
    with patch("rospy.loginfo") as loginfo:
        callback(state(2.0))
    assert "2.0" in loginfo.call_args.args[0]
    rospy["spin"].assert_called_once_with()


def test_step_3_reads_private_parameters():
    known = {"~my_integer": 3, "~my_string": "abc"}

    def get_param(name, *default):
        return known[name] if name in known else default[0]

    with patch("rospy.get_param", get_param):
        assert settings.describe() == "my_integer 3, my_float 1.0, my_string abc"


@pytest.mark.parametrize(
    ("name", "kind"), [("my_integer", int), ("my_float", float), ("my_string", str)]
)
def test_steps_4_and_5_the_launch_file_loads_the_parameters(name, kind):
    _, parameters = expand(PACKAGE / "launch" / "settings.launch")
    assert type(parameters[f"/settings/{name}"]) is kind
