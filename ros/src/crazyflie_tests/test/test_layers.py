"""Dependencies between the packages point one way, and ROS stays behind the node handle."""

import ast
import graphlib
import subprocess
import sys

import grimp
import pytest
from catkin_pkg.packages import find_packages
from importlinter.api import read_configuration
from importlinter.cli import lint_imports
from workspaces import TOP

SOURCES = TOP / "ros" / "src"
CONTRACTS = TOP / "importlinter.ini"
FOLDERS = {
    package.name: SOURCES / path / "src"
    for path, package in find_packages(str(SOURCES)).items()
    if (SOURCES / path / "src").is_dir()
}
#: Python package -> the catkin package that has it.
OWNERS = {init.parent.name: name for name, f in FOLDERS.items() for init in f.glob("*/__init__.py")}

#: In addition to the node handle, the module with which users' own nodes command a vehicle.
SPEAK_TO_ROSPY = {"crazyflie_utils", "crazyflie"}


@pytest.fixture
def sources(monkeypatch):
    """Find packages in the sources, since the devel space has stubs."""
    monkeypatch.setattr(sys, "path", [*map(str, FOLDERS.values()), *sys.path])
    # Modules that other tests have imported would still be found there.
    for name in [name for name in sys.modules if name.partition(".")[0] in OWNERS]:
        monkeypatch.delitem(sys.modules, name)


@pytest.fixture
def graph(sources):
    return grimp.build_graph(*OWNERS, include_external_packages=True, cache_dir=None)


def importers(graph, module):
    """Return the packages that import a module of others, or none if nothing does."""
    if module not in graph.modules:
        return set()
    return {name.partition(".")[0] for name in graph.find_modules_that_directly_import(module)}


def circle(graph):
    """Return a circle of modules, each of which is imported by the next; () without one."""
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    try:
        graphlib.TopologicalSorter(imports).prepare()
    except graphlib.CycleError as error:
        return tuple(error.args[1])
    return ()


def floors(config):
    (contract,) = config["contracts_options"]
    return {name.strip() for floor in contract["layers"] for name in floor.split("|")}


def test_every_package_has_a_floor():
    config = read_configuration(str(CONTRACTS))
    assert set(config["session_options"]["root_packages"]) == set(OWNERS) == floors(config)


def test_imports_come_from_lower_floors(sources, capsys):
    status = lint_imports(str(CONTRACTS), no_cache=True, is_debug_mode=False)
    assert status == 0, capsys.readouterr().out


def test_no_circle_of_modules_even_for_types_or_within_a_function(graph):
    assert len(graph.modules) > 200
    assert circle(graph) == ()


def test_imports_are_declared(graph):
    packages = {each.name: each for each in find_packages(str(SOURCES)).values()}
    undeclared = {
        (OWNERS[module], needed)
        for module in OWNERS
        for name in graph.find_descendants(module) | {module}
        for imported in graph.find_modules_directly_imported_by(name)
        if (needed := OWNERS.get(imported.split(".")[0], imported)) in packages
        and needed not in {each.name for each in packages[OWNERS[module]].exec_depends}
        and needed != OWNERS[module]
    }
    assert undeclared == set()


def test_no_package_needs_what_is_not_installed():
    needed = {
        each.name
        for package in find_packages(str(SOURCES)).values()
        for each in package.exec_depends
    }
    assert needed & {"crazyflie_dev", "crazyflie_tests"} == set()


def test_only_the_node_handle_speaks_to_rospy(graph):
    assert importers(graph, "rospy") <= SPEAK_TO_ROSPY


@pytest.mark.parametrize(
    "module",
    ["rospy", "genpy", "rosgraph", "std_msgs", "geometry_msgs", "crazyflie_msgs", "tf2_ros"],
)
def test_the_model_knows_nothing_of_ros(graph, module):
    assert "crazyflie_model" not in importers(graph, module)


IN_FUNCTIONS = {
    # Chosen at the first use of a name, so that what needs no ROS, or no cflib, does without.
    "crazyflie_mission_api/__init__.py",
    # Chosen by the command line: a node, or a program that does without ROS.
    "crazyflie_py/crazyswarm_py.py",
    # Optional: pictures, pages, schedulers and motion capture that may not be installed; gains that
    # are designed at the start.
    "crazyflie_batch/monte_carlo_command.py",
    "crazyflie_dashboard/dashboard_node.py",
    "crazyflie_lqr/design_command.py",
    "crazyflie_lqr/linear_feedback_node.py",
    "crazyflie_py/visualizer.py",
    "mocap_optitrack/library_worker.py",
    # Programs without ROS have parameters, but no names of topics.
    "crazyflie_utils/parameters/types.py",
    # Model files are read at the start, and most vehicles have none.
    "crazyflie_utils/parameters/vehicle_model.py",
    # cflib takes half a second, and the arguments may be wrong.
    "crazyflie_tools/tools.py",
}
"""Modules in which functions import. None of these functions runs in a flight."""


def test_imports_stand_at_the_top():
    """A function that imports stops a vehicle's streams for as long as it takes."""
    found = set()
    for folder in FOLDERS.values():
        for path in folder.rglob("*.py"):
            functions = (
                node
                for node in ast.walk(ast.parse(path.read_text()))
                if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            )
            if any(
                isinstance(node, ast.Import | ast.ImportFrom)
                for function in functions
                for node in ast.walk(function)
            ):
                found.add(str(path.relative_to(folder)))
    assert found == IN_FUNCTIONS


def package(folder, name, **modules):
    (folder / name).mkdir()
    for module, code in {"__init__": "", **modules}.items():
        (folder / name / f"{module}.py").write_text(code)


@pytest.fixture
def two_floors(tmp_path, monkeypatch):
    """Return what checks two packages, upper and lower, of which the lower has two modules."""

    def check(**lower):
        monkeypatch.syspath_prepend(tmp_path)
        package(tmp_path, "upper_floor", module="from lower_floor import first")
        package(tmp_path, "lower_floor", **{"first": "", "second": "", **lower})
        contracts = tmp_path / "contracts.ini"
        contracts.write_text(
            "[importlinter]\nroot_packages =\n  upper_floor\n  lower_floor\n"
            "[importlinter:contract:floors]\nname = floors\ntype = layers\n"
            "layers =\n  upper_floor\n  lower_floor\n"
        )
        graph = grimp.build_graph("upper_floor", "lower_floor", cache_dir=None)
        return lint_imports(str(contracts), no_cache=True), sorted(circle(graph)[:-1])

    return check


def test_floors_are_kept(two_floors):
    assert two_floors() == (0, [])


def test_an_import_from_an_upper_floor_is_found(two_floors):
    status, found = two_floors(second="def f():\n    from upper_floor import module")
    assert (status, found) == (1, [])


def test_a_circle_of_modules_is_found_even_for_types(two_floors):
    status, found = two_floors(
        first="from lower_floor import second",
        second="if TYPE_CHECKING:\n    from lower_floor.first import X",
    )
    assert (status, found) == (0, ["lower_floor.first", "lower_floor.second"])


def test_a_node_loads_nothing_that_finds_packages():
    """Modules that search for packages in the file system, and the modules that import them."""
    nodes = [
        "crazyflie_driver.server_node",
        "crazyflie_lqr.linear_feedback_node",
        "crazyflie_simulator.simulator_node",
        "crazyflie_state_estimator.estimator_node",
        "crazyflie_takeoff.takeoff_control_filter_node",
        "crazyflie_takeoff.takeoff_server_node",
        "crazyflie_utils.main",
    ]
    unwanted = {"setuptools", "pkg_resources", "distutils", "rosdistro", "rosdep2", "roslaunch"}
    unwanted |= {f"dynamic_reconfigure.{each}" for each in ("encoding", "client", "server")}
    program = f"import sys, {', '.join(nodes)}; print(*sys.modules)"
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True
    )
    loaded = set(printed.stdout.split())
    assert loaded >= set(nodes)
    assert unwanted & loaded == set()
    # Such as "the rosdep view is empty".
    assert printed.stderr == ""
