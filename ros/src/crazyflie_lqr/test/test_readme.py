"""The worked example of the README works."""

import re
from pathlib import Path

import pytest

from crazyflie_msgs.msg import (
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing import FakeProcess

PACKAGE = Path(__file__).parents[1]
PARAMETERS = {
    "x_dim": 7,
    "u_dim": 4,
    "K_file": str(PACKAGE / "config" / "K_soft.txt"),
    "u_ref_file": str(PACKAGE / "config" / "u_ref_hover.txt"),
    "topics/reference": "/ref",
    "topics/state": "/state",
    "topics/control": "/control/lqr",
}


@pytest.fixture
def node():
    """Return the example's node."""
    [code] = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.DOTALL)
    assert len(code.splitlines()) <= 45
    names = {"__name__": "example"}
    exec(compile(code, "README.md", "exec"), names)
    return names["GradualNode"]()


def test_a_controller_of_ones_own_replaces_the_lift_controller(node):
    process = FakeProcess()
    assert process.launch(node, "/lqr_controller", {**PARAMETERS, "reach": 0.2})
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(z=1.0))
    for x in (0.1, 0.2, 2.0):
        reference = PositionVelocityStateStamped(state=PositionVelocityState(x=x, z=1.0))
        process.publish("/ref", reference)
        process.publish("/state", state)
    pitches = [message.control.pitch for message in process.published("/control/lqr")]
    assert pitches == pytest.approx([0.025, 0.05, 0.05])


def test_its_own_parameter_is_checked(node):
    process = FakeProcess()
    assert not process.launch(node, "/lqr_controller", {**PARAMETERS, "reach": 0.0})
    assert (
        "/lqr_controller/reach is 0.0; expected a finite number > 0 (m)"
        in (process.logged("error")[0])
    )
