"""Launch files without a master: expanded as roslaunch does, and their nodes in one process."""

import re
from pathlib import Path
from unittest.mock import patch

from roslaunch.config import ROSLaunchConfig
from roslaunch.core import Node
from roslaunch.xmlloader import XmlLoader
from roslib.packages import find_node

from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing.fake_process import FakeProcess


def expand(path: Path, **arguments: object) -> tuple[dict[str, Node], dict[str, object]]:
    """Return the nodes by full name, and the values of parameters by full name.

    Names of anonymous nodes are without their unique suffix.
    """
    given = [f"{name}:={value}" for name, value in arguments.items()]
    config = ROSLaunchConfig()
    with patch("rosgraph.names.anonymous_name", lambda name: name):
        # roslaunch would also load roscore's file, which starts two programs for ROS's version.
        XmlLoader().load(str(path), config, argv=given, verbose=False)
    nodes = {node.namespace.rstrip("/") + "/" + node.name: node for node in config.nodes}
    return nodes, {name: parameter.value for name, parameter in config.params.items()}


def composed_nodes(parameters: dict[str, object]) -> dict[str, str]:
    """Return the nodes of the composed process in the parameters: class path by node name."""
    listed = "/composed/nodes/"
    return {
        name.removeprefix(listed): str(value)
        for name, value in parameters.items()
        if name.startswith(listed)
    }


def launch(path: Path, start: float = 100.0, **arguments: object) -> FakeProcess:
    """Return a process without ROS, begun at ``start`` (s), with the nodes of a launch file.

    The file has the argument ``composed``; see `expand`.
    """
    _, parameters = expand(path, **{"composed": "true", "rviz": "false", **arguments})
    process = FakeProcess(parameters, start)
    for name, node in NODE_CLASSES(composed_nodes(parameters)).items():
        assert process.launch(node(), f"/{name}"), process.logged("error")
    return process


def node_class(node: Node) -> str:
    """Return the "package.module:Class" that a node's program runs; ValueError for other programs.

    The program is one of `crazyflie_add_program`, and the only one of its name.
    """
    [program] = find_node(node.package, node.type)
    if found := re.search(r'^run\("([\w.]+:\w+)"', Path(program).read_text(), re.MULTILINE):
        return found[1]
    raise ValueError(f"{program} is not made by crazyflie_add_program with NODE")
