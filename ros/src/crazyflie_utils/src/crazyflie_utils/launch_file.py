"""Launch files without a master, expanded as roslaunch does."""

import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

from roslaunch.config import ROSLaunchConfig
from roslaunch.core import Node
from roslaunch.rlutil import resolve_launch_arguments
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


class _ArgumentReader(XmlLoader):
    """Collects the arguments that reach a launch file, or what it includes with all arguments."""

    def __init__(self) -> None:
        super().__init__(resolve_anon=False)
        self.names: set[str] = set()
        self._closed = 0  # Number of includes around the present place that pass theirs only.

    def _include_tag(self, tag, *rest, **options):
        is_closed = tag.getAttribute("pass_all_args") != "true"
        self._closed += is_closed
        super()._include_tag(tag, *rest, **options)
        self._closed -= is_closed

    def _arg_tag(self, tag, *rest, **options):
        if not self._closed and not tag.hasAttribute("value"):
            self.names.add(tag.getAttribute("name"))
        super()._arg_tag(tag, *rest, **options)


def unknown_arguments(words: Sequence[str]) -> list[str]:
    """Return what is wrong with the arguments of roslaunch, which ignores those that it never uses.

    ``words`` are package, launch file and NAME:=VALUE. Raises what roslaunch raises.
    """
    given = [word for word in words if re.match(r"\w+:=", word) and not word.startswith("_")]
    file, *_ = resolve_launch_arguments([word for word in words if ":=" not in word])
    reader = _ArgumentReader()
    reader.load(file, ROSLaunchConfig(), argv=given, verbose=False)
    problems = []
    for name in (word.partition(":=")[0] for word in given):
        if name not in reader.names:
            near = difflib.get_close_matches(name, reader.names, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            problems.append(f"{Path(file).name} has no argument {name}{hint}")
    return problems


def composed_nodes(parameters: dict[str, object]) -> dict[str, str]:
    """Return the nodes of the composed process in the parameters: class path by node name."""
    listed = "/composed/nodes/"
    return {
        name.removeprefix(listed): str(value)
        for name, value in parameters.items()
        if name.startswith(listed)
    }
