"""Dependencies between the packages point one way, and ROS stays behind the node handle."""

import ast

import pytest
from workspaces import TOP

SOURCES = TOP / "ros" / "src"
PACKAGES = {
    path.name: path
    for pattern in (
        "*/src/*/__init__.py",
        "crazyflie_ros/*/src/*/__init__.py",
        "crazyflie_tutorials/*/src/*/__init__.py",
    )
    for path in (init.parent for init in SOURCES.glob(pattern))
}

LAYERS = [
    {"crazyflie_msgs", "crazyflie_model", "crazyflie_tutorial_msgs"},
    {"crazyflie_utils"},
    {
        "crazyflie_simulator",
        "crazyflie_state_estimator",
        "crazyflie_lqr",
        "crazyflie_control_merger",
        "crazyflie_geofence",
        "crazyflie_takeoff",
        "crazyflie_description",
        "crazyflie_controller",
        "crazyflie_link",
        "crazyflie_references",
        "crazyflie_reports",
        "crazyflie_sweep",
        "crazyflie_package_generator",
        "crazyflie_spawner",
        "crazyflie_world",
        "mocap_optitrack",
    },
    {
        "crazyflie_batch",
        "crazyflie_doctor",
        "crazyflie_driver",
        "crazyflie_teleop",
        "crazyflie_tools",
        "crazyflie_virtual",
    },
    {"crazyflie_dashboard", "crazyflie_fleet"},
    {"crazyflie_demo", "crazyflie_examples", "crazyflie_ranging", "crazyflie_vision"},
    {"crazyflie_mission_api", "uav_trajectory"},
    {"crazyflie", "crazyflie_dev", "crazyflie_py"},
    {"pycrazyswarm"},
]
"""From the bottom: a package imports from lower layers only."""

SPEAK_TO_ROSPY = {"crazyflie_utils", "crazyflie"}
"""Beside the node handle, the module with which users' own nodes command a vehicle."""


def imported(package):
    """Return the top-level modules that the files of a package import."""
    names = set()
    for path in PACKAGES[package].rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {name.name.partition(".")[0] for name in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module.partition(".")[0])
    return names


def layer_of(package):
    """Return the number of a package's layer, from the bottom."""
    return next(k for k, layer in enumerate(LAYERS) if package in layer)


def test_every_package_has_a_layer():
    assert set(PACKAGES) <= set().union(*LAYERS)


@pytest.mark.parametrize("package", sorted(PACKAGES))
def test_imports_come_from_lower_layers(package):
    own = imported(package) & set().union(*LAYERS) - {package}
    assert {name for name in own if layer_of(name) >= layer_of(package)} == set()


@pytest.mark.parametrize("package", sorted(set(PACKAGES) - SPEAK_TO_ROSPY))
def test_only_the_node_handle_speaks_to_rospy(package):
    assert "rospy" not in imported(package)


def test_the_model_knows_nothing_of_ros():
    ros = {"rospy", "genpy", "rosgraph", "std_msgs", "geometry_msgs", "crazyflie_msgs", "tf2_ros"}
    assert imported("crazyflie_model") & ros == set()


IN_FUNCTIONS = {
    # Chosen at the first use of a name, so that what needs no ROS, or no cflib, does without.
    "crazyflie_mission_api/__init__.py",
    # Chosen by the command line: a node, or a program that does without ROS.
    "crazyflie_py/crazyswarm_py.py",
    "crazyflie_virtual/main.py",
    # Optional: pictures, pages, schedulers and motion capture that may not be installed.
    "crazyflie_batch/monte_carlo_command.py",
    "crazyflie_dashboard/dashboard_node.py",
    "crazyflie_lqr/design_command.py",
    "crazyflie_py/visualizer.py",
    "mocap_optitrack/library_worker.py",
    # Programs without ROS have parameters, but no names of topics.
    "crazyflie_utils/parameters/types.py",
    # cflib takes half a second, and the arguments may be wrong.
    "crazyflie_tools/tools.py",
}
"""Modules in which functions import. None of these functions runs in a flight."""


def test_imports_stand_at_the_top():
    """A function that imports stops a vehicle's streams for as long as it takes."""
    found = set()
    for package in PACKAGES.values():
        for path in package.rglob("*.py"):
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
                found.add(str(path.relative_to(package.parent)))
    assert found == IN_FUNCTIONS
