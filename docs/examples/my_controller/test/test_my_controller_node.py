"""The controller on a fake process: parameters in a dictionary, no ROS."""

import re
from pathlib import Path

import numpy as np
import pytest

from crazyflie_lqr import design_command
from crazyflie_lqr.gain_file import load_matrix
from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess
from my_controller.my_controller_node import MyControllerNode

U_REF = "0 0 0 9.81"
K_FILE = Path(__file__).parents[1] / "config" / "K.txt"


@pytest.fixture
def parameters(tmp_path):
    """Return the parameters that every controller needs."""
    u_ref_file = tmp_path / "u_ref.txt"
    u_ref_file.write_text(U_REF)
    return {
        "x_dim": 7,
        "u_dim": 4,
        "K_file": str(K_FILE),
        "u_ref_file": str(u_ref_file),
        "topics/reference": "/ref",
        "topics/state": "/state",
        "topics/control": "/control/lqr",
    }


def control_at(parameters, x, **changes):
    """Return the control for a vehicle that is at x (m) and should be at 0.

    Changes of parameters are made in flight, as dynamic_reconfigure does.
    """
    process = FakeProcess()
    assert process.launch(MyControllerNode(), "/lqr_controller", parameters)
    if changes:
        process.reconfigure("/lqr_controller", **changes)
    reference = PositionVelocityStateStamped(state=PositionVelocityState(z=1.0))
    process.publish("/ref", reference)
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=x, z=1.0))
    process.publish("/state", state)
    [message] = process.published("/control/lqr")
    return message.control


def test_turns_towards_the_heading(parameters):
    assert control_at({**parameters, "heading": 0.5}, 0.0).yaw_dot == pytest.approx(2.0 * 0.5)
    assert control_at(parameters, 0.0).yaw_dot == 0.0


def test_tilts_no_more_than_it_may(parameters):
    assert control_at(parameters, -2.0).pitch == 0.2
    assert control_at({**parameters, "max_tilt": 0.05}, 2.0).pitch == -0.05
    assert control_at(parameters, 2.0, max_tilt=0.05).pitch == -0.05


def test_a_bad_parameter_is_named(parameters):
    process = FakeProcess()
    bad = {**parameters, "max_tilt": 0}
    assert not process.launch(MyControllerNode(), "/lqr_controller", bad)
    expected = "parameter /lqr_controller/max_tilt is 0; expected a finite number > 0 (rad)"
    assert process.logged("error") == [f"/lqr_controller: {expected}"]


def test_gains_are_those_of_the_command_in_their_comment(tmp_path):
    [command] = re.findall("^# design_gains (.*)", K_FILE.read_text(), re.MULTILINE)
    designed = tmp_path / "K.txt"
    assert design_command.main([*command.split(), "--out", str(designed)]) == 0
    expected = load_matrix(str(designed), 4, 7)
    np.testing.assert_allclose(load_matrix(str(K_FILE), 4, 7), expected, atol=1e-9)
