"""The RViz configuration."""

from pathlib import Path

import yaml

LAUNCH = Path(__file__).resolve().parent.parent / "launch"


def displays():
    manager = yaml.safe_load((LAUNCH / "crazyflie.rviz").read_text())["Visualization Manager"]
    return {display["Class"]: display for display in manager["Displays"]}, manager


def test_shows_what_there_is_to_see():
    shown, manager = displays()
    assert manager["Global Options"]["Fixed Frame"] == "world"
    assert set(shown) == {
        "rviz/Grid",
        "rviz/Axes",
        "rviz/TF",
        "rviz/RobotModel",
        "rviz/MarkerArray",
    }
    assert all(display["Enabled"] for display in shown.values())
    assert shown["rviz/RobotModel"]["Robot Description"] == "robot_description"
    assert shown["rviz/MarkerArray"]["Marker Topic"] == "/visualizer/markers"


def test_names_no_frame_of_the_vehicle():
    shown, _ = displays()
    assert shown["rviz/RobotModel"]["TF Prefix"] == ""
    assert shown["rviz/Axes"]["Reference Frame"] == "<Fixed Frame>"
    assert shown["rviz/TF"]["Frames"] == {"All Enabled": True}
