"""Examples on two virtual vehicles behind the driver; they stand at y = -0.5 and 0.5 m."""

import numpy as np
import pytest
import rospy
from scripted import EXAMPLES, fly, run

NEAR = 0.15
"""m; the vehicles estimate their positions."""


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
