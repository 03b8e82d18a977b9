"""Launch files without a master, expanded as roslaunch does."""

from pathlib import Path
from unittest.mock import patch

from roslaunch.config import ROSLaunchConfig
from roslaunch.core import Node
from roslaunch.xmlloader import XmlLoader


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
