"""No module imports itself by way of others, not even for types or within a function."""

import ast

from test_layers import PACKAGES

KNOWN = {
    "crazyflie_driver.farewell",
    "crazyflie_driver.flight_commands",
    "crazyflie_driver.flight_state",
    "crazyflie_driver.services",
    "crazyflie_driver.vehicle",
}
"""Modules that are in circles; none is added."""


def modules():
    """Return the file of each module of the workspace, by its full name."""
    return {
        ".".join((name, *path.relative_to(folder).with_suffix("").parts)).removesuffix(
            ".__init__"
        ): path
        for name, folder in PACKAGES.items()
        for path in folder.rglob("*.py")
    }


def imports(tree, known):
    """Return the modules of the workspace that a module names in its imports, wherever they are."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in known else node.module)
    return found & known


def circles(graph):
    """Return the sets of modules that import each other."""
    reached = {}
    for start in graph:
        seen, rest = set(), list(graph[start])
        while rest:
            name = rest.pop()
            if name not in seen:
                seen.add(name)
                rest += graph[name]
        reached[start] = seen
    return {
        frozenset(other for other in reached[name] if name in reached[other])
        for name in graph
        if name in reached[name]
    }


def test_modules_import_one_way():
    files = modules()
    assert len(files) > 200
    graph = {
        name: imports(ast.parse(path.read_text()), files.keys()) - {name}
        for name, path in files.items()
    }
    assert set().union(*circles(graph)) <= KNOWN


def test_a_circle_is_found():
    graph = {"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}
    assert circles(graph) == {frozenset("bc")}
