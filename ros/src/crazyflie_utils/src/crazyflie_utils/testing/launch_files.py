"""Launch files without a master: their nodes in one process, see also `launch_file`."""

import re
from pathlib import Path

from roslaunch.core import Node
from roslib.packages import find_node

from crazyflie_utils.launch_file import composed_nodes, expand
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing.fake_process import FakeProcess


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
