"""The launch fragment for RViz, expanded by roslaunch without a master."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import rospkg
import yaml

from crazyflie_description.visualizer_node import VisualizerNode
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files

PACKAGES = rospkg.RosPack()
FRAGMENT = Path(PACKAGES.get_path("launch_shared")) / "launch" / "rviz.launch"


def expand(**arguments):
    """Return nodes and parameters by name."""
    return launch_files.expand(FRAGMENT, **arguments)


def root_link(description):
    return ElementTree.fromstring(description).find("link").get("name")


def test_starts_rviz_and_the_visualizer():
    nodes, parameters = expand(fixed_frame="map")
    assert set(nodes) == {"/rviz", "/visualizer"}
    assert nodes["/rviz"].args.endswith("-f map")
    assert not nodes["/rviz"].required
    assert root_link(parameters["/robot_description"]) == "base_link"


def test_the_model_follows_the_robots_frame():
    nodes, parameters = expand(robot_frame="vicon/cf7/cf7")
    assert root_link(parameters["/rviz/robot_description"]) == "vicon/cf7/cf7/base_link"
    assert nodes["/rviz"].remap_args == [["robot_description", "rviz/robot_description"]]


@pytest.mark.parametrize("composed", ["false", "true"])
def test_the_visualizer_finds_its_parameters(composed):
    nodes, parameters = expand(
        fixed_frame="map", robot_frame="cf7", reference_topic="/cf7/ref", composed=composed
    )
    assert ("/visualizer" in nodes) == (composed == "false")
    process = FakeProcess(parameters)
    assert process.launch(VisualizerNode(), "/visualizer"), process.logged("error")
    assert "/cf7/ref" in process.transport.subscribers
    configuration = Path(PACKAGES.get_path("crazyflie_description")) / "launch" / "crazyflie.rviz"
    shown = yaml.safe_load(configuration.read_text())["Visualization Manager"]["Displays"]
    topics = [display["Marker Topic"] for display in shown if "Marker Topic" in display]
    assert topics == ["/visualizer/markers"]
    assert set(topics) <= set(process.transport.publishers)


def test_the_composed_process_can_make_a_visualizer():
    _, parameters = expand(composed="true")
    listed = {"visualizer": parameters["/composed/nodes/visualizer"]}
    assert NODE_CLASSES(listed) == {"visualizer": VisualizerNode}


def test_without_rviz_there_is_only_the_description():
    nodes, parameters = expand(rviz="false")
    assert nodes == {}
    assert "/robot_description" in parameters
    assert not [name for name in parameters if "visualizer" in name or "/rviz" in name]


def test_visualizer_can_run_without_rviz():
    nodes, _ = expand(rviz="false", visualizer="true")
    assert set(nodes) == {"/visualizer"}
