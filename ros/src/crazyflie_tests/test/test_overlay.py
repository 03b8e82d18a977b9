"""A workspace on top of this one, with a controller and messages of its own."""

import re

import pytest
from workspaces import BUILD_LIMIT, FAST, FLY, TOP, overlay

MESSAGES = {
    "package.xml": """<package format="3">
        <name>my_msgs</name>
        <version>0.1.0</version>
        <description>A message in which there is one of ours.</description>
        <maintainer email="nobody@example.com">nobody</maintainer>
        <license>BSD-3-Clause</license>
        <buildtool_depend>catkin</buildtool_depend>
        <build_depend>message_generation</build_depend>
        <depend>crazyflie_msgs</depend>
        <exec_depend>message_runtime</exec_depend>
    </package>""",
    "CMakeLists.txt": """
        cmake_minimum_required(VERSION 3.5)
        project(my_msgs)
        find_package(catkin REQUIRED COMPONENTS crazyflie_msgs message_generation)
        add_message_files(FILES Plan.msg)
        generate_messages(DEPENDENCIES crazyflie_msgs std_msgs)
        catkin_package(CATKIN_DEPENDS crazyflie_msgs message_runtime)
    """,
    "msg/Plan.msg": "crazyflie_msgs/ControlStamped[] controls\n",
}


@pytest.fixture
def my_workspace(tmp_path):
    """Return a workspace, not built, with the example's controller and a package of messages."""
    folder = overlay(tmp_path / "my_workspace", "my_controller")
    for name, text in MESSAGES.items():
        file = folder / "src" / "my_msgs" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return folder


@pytest.fixture(params=["devel", pytest.param("install", marks=pytest.mark.long)])
def underlay(request):
    """Return the space below: this workspace, or a copy that is installed.

    A file that is missing in the second is also missing in test_install_rules.py.
    """
    if request.param == "devel":
        return TOP / "ros" / "devel"
    return request.getfixturevalue("install_space")


def test_controller_of_ones_own_flies(underlay, my_workspace, shell):
    terminal = shell(my_workspace)
    terminal.run(f"source {underlay}/setup.bash")
    terminal.run("catkin_make", BUILD_LIMIT)
    terminal.run("source devel/setup.bash")
    executable = terminal.run("catkin_find --first-only my_controller my_controller_node")
    assert str(my_workspace) in executable
    assert "crazyflie_msgs/ControlStamped[]" in terminal.run("rosmsg show my_msgs/Plan")
    flight = terminal.run(f"{FLY} my_controller my_hover.launch heading:=0.5 {FAST}")
    # lqr_controller holds the yaw at 0.
    [yaw] = re.findall(r"yaw at the end: (\S+)", flight)
    assert float(yaw) == pytest.approx(0.5, abs=0.01)
