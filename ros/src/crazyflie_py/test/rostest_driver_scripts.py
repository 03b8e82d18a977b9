"""Examples on two virtual vehicles behind the driver; they stand at y = -0.5 and 0.5 m."""

from pathlib import Path

import numpy as np
import pytest
import rospy
from scripted import EXAMPLES, ctrl_c, fly, kill_node, run, run_until

from crazyflie_msgs.msg import VehicleStatus
from crazyflie_utils.testing.programs import wait_until

NEAR = 0.15  #: m; the vehicles estimate their positions.


@pytest.fixture(scope="module", autouse=True)
def vehicles():
    """Wait for both vehicles: a script has those that are there when it starts."""
    for name in ("cf1", "cf2"):
        rospy.wait_for_service(f"/{name}/upload_trajectory", 30.0)


def test_groups():
    track = fly("group_mask.py")
    assert track[0, :, 2] == pytest.approx([1.0, 0.0], abs=NEAR)
    assert track[2, :, 2] == pytest.approx([1.0, 1.0], abs=NEAR)
    assert track[3, :, 2].max() < 0.2


def test_parameters():
    printed = run(EXAMPLES / "led_and_parameters.py")
    assert "1 7 0.5" in printed
    assert "2 7 0.5" in printed


def test_setpoints():
    track = fly("velocity_circle.py")[:, 0]
    assert np.ptp(track[:, 0]) == pytest.approx(0.8, abs=0.25)
    assert track[-1, 2] < 0.2


STREAMING = """
import threading


def stream():
    x, y, _ = swarm.allcfs.crazyflies[0].position()
    while True:
        swarm.allcfs.crazyflies[0].cmdPosition([x, y, 0.8])
        rospy.sleep(0.05)


thread = threading.Thread(target=stream, daemon=True)
thread.start()
rospy.spin()
"""


SWALLOWING = """
while True:
    try:
        swarm.timeHelper.sleep(1e6)
    except KeyboardInterrupt:
        pathlib.Path(sys.argv[1] + ".again").touch()
"""


def ctrl_c_twice(process):
    """Send a second signal when the script has handled the first one, and flies on."""
    ctrl_c(process)
    wait_until(Path(process.args[2] + ".again").exists, "the first one's end")
    ctrl_c(process)


@pytest.mark.parametrize(
    ("ending", "end"),
    [("rospy.spin()", ctrl_c), (SWALLOWING, ctrl_c_twice), (STREAMING, kill_node)],
)
def test_vehicles_of_the_driver_are_landed_before_ros_is_shut_down(tmp_path, ending, end):
    errors = run_until(tmp_path, ending, end)
    assert "landing cf1, cf2" in errors
    assert "MAY STILL FLY" not in errors
    # Nobody else would land them.
    status = [rospy.wait_for_message(f"/{n}/vehicle_status", VehicleStatus) for n in ("cf1", "cf2")]
    assert not any(each.supervisor & VehicleStatus.FLYING for each in status), status
    # Setpoints during the landing would have stopped it.
    assert ending != STREAMING or "its vehicles land, and are not commanded any more" in errors
