"""The controller of the hover does without numpy, which would be most of what it imports."""

import subprocess
import sys
from pathlib import Path

PROGRAM = """
import sys
import crazyflie_utils.ros1.light_rospy
from crazyflie_lqr.gain_file import MatrixFile, VectorFile
from crazyflie_lqr.linear_feedback import IntegralStateFeedback
from crazyflie_lqr.position_velocity_yaw_state_lift_lqr_node import (
    PositionVelocityYawStateLiftLqrNode as Node,
)

K, u_ref = MatrixFile(4, 7)(sys.argv[1]), VectorFile(4)(sys.argv[2])
controller = IntegralStateFeedback(K, u_ref, Node.yaw_index)
controller.take_off()
u = controller.law([0.0] * 7, (0.0, 0.0, 1.0, *[0.0] * 4), 0.0)
assert u[3] > 9.81, u
print(*sys.modules)
"""


def test_the_controller_of_the_hover_does_without_numpy():
    config = Path(__file__).resolve().parents[1] / "config"
    files = [str(config / name) for name in ("K_hover.txt", "u_ref_hover.txt")]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *files],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "rospy" in done.stdout.split()
    assert "numpy" not in done.stdout.split()
