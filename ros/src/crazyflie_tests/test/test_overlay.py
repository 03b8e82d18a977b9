"""A workspace on top of this one, with a controller of its own that flies."""

import re

import pytest
from workspaces import BUILD_LIMIT, FAST, FLY, overlay


@pytest.mark.parametrize("underlay", ["devel", "install"])
def test_controller_of_ones_own_flies(underlay, workspace, shell, tmp_path):
    terminal = shell(overlay(tmp_path / "my_workspace", "my_controller"))
    terminal.run(f"source {workspace}/ros/{underlay}/setup.bash")
    terminal.run("catkin_make", BUILD_LIMIT)
    terminal.run("source devel/setup.bash")
    executable = terminal.run("catkin_find --first-only my_controller my_controller_node")
    assert str(tmp_path) in executable
    flight = terminal.run(f"python3 {FLY} my_controller my_hover.launch heading:=0.5 {FAST}")
    # lqr_controller holds the yaw at 0.
    [yaw] = re.findall(r"yaw at the end: (\S+)", flight)
    assert float(yaw) == pytest.approx(0.5, abs=0.01)
