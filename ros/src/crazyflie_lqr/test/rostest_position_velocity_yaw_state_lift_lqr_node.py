"""The lift controller in a process of its own, on a real master."""

import subprocess

import pytest
import rospkg
import rospy

from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing.peer import exchange

CONFIG = rospkg.RosPack().get_path("crazyflie_lqr") + "/config"


def test_answers_a_state():
    reference = PositionVelocityStateStamped(state=PositionVelocityState(z=1.0))
    state = PositionVelocityYawStateStamped(state=PositionVelocityYawState(x=0.2, z=0.8))
    state.header.stamp = rospy.Time(12, 345)
    control = exchange(
        {"/lift/ref": reference, "/lift/state": state}, "/lift/control", ControlStamped
    )
    assert control.header.stamp == state.header.stamp
    assert control.control.pitch == pytest.approx(-0.05)
    assert control.control.thrust == pytest.approx(9.81 + 0.3)


@pytest.mark.parametrize(
    ("content", "reason"),
    [("1 2 3 4 5 6 7\n0 0 O 0 0 0 0\n", "line 2: 'O' is not a number"), (None, "No such file")],
)
def test_exits_with_1_when_the_gains_are_bad(tmp_path, content, reason):
    gains = tmp_path / "K.txt"
    if content is not None:
        gains.write_text(content)
    command = ["rosrun", "crazyflie_lqr", "position_velocity_yaw_state_lift_lqr_node"]
    parameters = {
        "x_dim": 7,
        "u_dim": 4,
        "K_file": gains,
        "u_ref_file": f"{CONFIG}/u_ref_hover.txt",
        "topics/reference": "/ref",
        "topics/state": "/state",
        "topics/control": "/control/bad",
    }
    command += ["__name:=badly_tuned"] + [f"_{name}:={v}" for name, v in parameters.items()]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert result.returncode == 1
    output = result.stdout + result.stderr
    for part in ("/badly_tuned/K_file", str(gains), reason, "expected 4 rows of 7 numbers"):
        assert part in output
