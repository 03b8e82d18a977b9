"""The launch file, as roslaunch reads it, without launching anything."""

from pathlib import Path

import pytest
from roslaunch.config import load_config_default
from roslib.packages import find_node

from crazyflie_utils.testing.launch_files import expand

FILE = Path(__file__).resolve().parents[1] / "launch" / "trio.launch"


def velocities(nodes, name):
    """Return the topic that ``cmd_vel`` is for a node, after remapping."""
    node = nodes[name]
    return dict(node.remap_args).get("cmd_vel", f"{node.namespace.rstrip('/')}/cmd_vel")


def test_roslaunch_finds_no_fault_and_every_program():
    config = load_config_default([str(FILE)], None)
    assert config.config_errors == []
    assert config.nodes
    assert [node.type for node in config.nodes if not find_node(node.package, node.type)] == []


def test_all_vehicles_and_both_circles_are_there():
    nodes, _ = expand(FILE)
    assert {"/leader/circle", "/soloist/circle"} <= set(nodes)
    assert {f"/{name}/composed" for name in ("left", "middle", "right")} <= set(nodes)


@pytest.mark.parametrize(("tight", "y"), [("false", 1.0), ("true", 0.5)])
def test_the_outer_vehicles_are_as_far_apart_as_tight_says(tight, y):
    _, parameters = expand(FILE, tight=tight)
    places = [parameters[f"/{name}/simulator/init/y"] for name in ("left", "middle", "right")]
    assert places == [y, 0.0, -y]


def test_the_circles_are_as_large_and_slow_as_asked_for():
    _, parameters = expand(FILE)
    assert parameters["/soloist/circle/radius"] == 0.25
    assert parameters["/soloist/circle/speed"] == parameters["/leader/circle/speed"] == 0.1


def test_other_arguments_are_handed_on():
    _, parameters = expand(FILE, radius="0.7")
    assert parameters["/leader/circle/radius"] == 0.7


def test_the_graph_has_two_circles_with_the_right_followers():
    nodes, _ = expand(FILE)
    assert velocities(nodes, "/leader/circle") == velocities(nodes, "/left/composed")
    assert velocities(nodes, "/leader/circle") == velocities(nodes, "/right/composed")
    assert velocities(nodes, "/soloist/circle") == "/middle/cmd_vel"
    assert velocities(nodes, "/middle/composed") == "/middle/cmd_vel"
