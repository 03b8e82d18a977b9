"""What nodes read comes through the handle, and is in their journals; or they say what does not."""

import ast
import importlib
import inspect
import sys
from pathlib import Path

import pytest
from workspaces import TOP

from crazyflie_utils import Node

SOURCES = TOP / "ros" / "src"
#: Packages whose modules are the handle's own side, or are not flown.
NOT_SEARCHED = ("crazyflie_utils", "crazyflie_dev", "crazyflie_tests")

#: Names that a call may not begin with.
FORBIDDEN = (
    "time.time", "time.monotonic", "time.perf_counter", "time.sleep", "datetime.now",
    "datetime.datetime.now", "np.random.", "numpy.random.", "uuid.", "secrets.",
    "os.urandom", "os.open", "os.read", "os.environ", "os.getenv", "open", "socket.",
    "subprocess.", "threading.Thread", "select.",
)  # fmt: skip
#: Methods that read files.
METHODS = (".read_text", ".read_bytes", ".open")
#: Modules that use them as they may: why.
ALLOWED = {
    "crazyflie_lqr.gain_file": "writes files of design_gains; reads by text_file.content",
    "crazyflie_link.address": "reads the parts of an address",
    "crazyflie_demo.joystick": "JoyNode alone opens a joystick",
    "crazyflie_driver.vehicle_base": "a thread started by handle.start, whose output is input",
    **dict.fromkeys(
        (
            f"mocap_optitrack.{each}"
            for each in ("source", "library_source", "library_worker", "natnet_source")
        ),
        "a thread started by handle.start, whose output is input",
    ),
}


def modules():
    """Return the modules of all nodes, by name, and the files of all modules."""
    files = {}
    for path in SOURCES.glob("**/src/**/*.py"):
        inside = path.relative_to(next(each for each in path.parents if each.name == "src"))
        files[".".join(inside.with_suffix("").parts).removesuffix(".__init__")] = path
    return files


FILES = modules()
ALLOWED |= dict.fromkeys(
    (each for each in FILES if each.startswith("crazyflie_link.")),
    "the driver alone uses links, as externals: crazyflie_driver.vehicle_link",
)


def test_the_driver_alone_makes_links():
    """Of the modules that are nodes; in its place it has what is in the journal."""
    makers = {
        name
        for node in CLASSES
        for name in reachable(node.__module__)
        if not name.startswith("crazyflie_link.")
        and {"crazyflie_link.crazyflie.Crazyflie", "crazyflie_link.broadcast.Broadcaster"}
        & set(own_imports(ast.parse(FILES[name].read_text())))
    }
    assert makers == {"crazyflie_driver.vehicle_link"}


def calls(tree):
    """Yield the names of all that is called, and their lines."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), node
        elif isinstance(node, ast.Subscript):
            yield ast.unparse(node.value), node


def is_seeded(name, node):
    if "default_rng(" in name and "default_rng()" not in name:
        return True
    return name.endswith((".default_rng", ".Random")) and bool(getattr(node, "args", ()))


def own_imports(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{each.name}" for each in node.names)
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names)


def reachable(module):
    """Return the modules of the workspace that a module imports, and those that these import."""
    found, waiting = set(), [module]
    while waiting:
        name = waiting.pop()
        if name in found or name not in FILES or name.partition(".")[0] in NOT_SEARCHED:
            continue
        found.add(name)
        waiting += own_imports(ast.parse(FILES[name].read_text()))
    return found


def violations(module):
    tree = ast.parse(FILES[module].read_text())
    # A generator may be called random, too.
    forbidden = FORBIDDEN + (("random.",) if "random" in own_imports(tree) else ())
    for name, node in calls(tree):
        is_forbidden = any(
            name == each or (name.startswith(each) and each != "open") for each in forbidden
        )
        if (is_forbidden or name.endswith(METHODS)) and not is_seeded(name, node):
            yield f"{module}:{node.lineno}: {name}"


def node_classes():
    for name, path in sorted(FILES.items()):
        if name.partition(".")[0] in NOT_SEARCHED or "Node" not in path.read_text():
            continue
        module = importlib.import_module(name)
        for _, each in inspect.getmembers(module, inspect.isclass):
            if issubclass(each, Node) and each.__module__ == name:
                yield each


CLASSES = list(node_classes())


@pytest.mark.parametrize("node", CLASSES, ids=lambda each: each.__qualname__)
def test_all_that_a_node_reads_is_in_its_journal(node):
    if node.sources:
        return
    found = [
        each
        for module in sorted(reachable(node.__module__) - set(ALLOWED))
        for each in violations(module)
    ]
    assert not found


def test_all_nodes_are_found():
    assert len(CLASSES) > 50


def test_what_is_forbidden_is_found(tmp_path, monkeypatch):
    path = tmp_path / "bad.py"
    path.write_text("import time, random\nrandom.random()\ntime.time()\nrandom.Random(3)\n")
    monkeypatch.setitem(FILES, "bad", Path(path))
    assert [each.rpartition(" ")[2] for each in violations("bad")] == ["random.random", "time.time"]
    assert sys.modules.get("bad") is None
