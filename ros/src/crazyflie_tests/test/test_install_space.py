"""The install space has everything, and flies when there is nothing else."""

import contextlib
import os
from pathlib import Path

import pytest
from catkin_pkg.packages import find_packages
from workspaces import FAST, FLY, TOP

PACKAGES = {
    package.name: TOP / "ros" / "src" / path
    for path, package in find_packages(str(TOP / "ros" / "src")).items()
    if package.name not in ("crazyflie_dev", "crazyflie_tests") and not package.is_metapackage()
}
INSPECT = Path(__file__).with_name("inspect_install.py")


def code_of(script):
    """Return a script without its first line."""
    return script.read_text().split("\n", 1)[1]


@contextlib.contextmanager
def put_away(top):
    """Take everything but the install space of a workspace away, for a time."""
    ros = top / "ros"
    away = top / "away"
    away.mkdir()
    folders = [ros / name for name in ("src", "launch_shared", "build", "devel")]
    for folder in folders:
        folder.rename(away / folder.name)
    try:
        yield
    finally:
        for folder in folders:
            (away / folder.name).rename(folder)
        away.rmdir()


@pytest.fixture
def terminal(workspace, install_space, shell):
    """Return a shell that knows the install space, and nothing else is there.

    Its ``run`` asserts that a command succeeds.
    """
    with put_away(workspace):
        terminal = shell(workspace)
        terminal.run(f"source {install_space}/setup.bash")
        yield terminal


def test_commands_of_the_installation(workspace):
    # They are what has made the workspace.
    for space in ("devel", "install"):
        assert (workspace / "ros" / space / "setup.bash").is_file()


def test_flies(terminal):
    terminal.run(f"{FLY} crazyflie_examples sw_hover.launch {FAST}")


def test_knows_of_nothing_else(terminal, workspace):
    environment = terminal.run("env")
    for folder in ("devel", "src", "build"):
        assert f"{workspace}/ros/{folder}" not in environment


def test_tools_of_developers_are_not_installed(install_space):
    assert not list(install_space.rglob("crazyflie_dev*"))


def test_modules_and_launch_files_are_complete(terminal, install_space):
    terminal.run(f"python3 {INSPECT} {install_space} {' '.join(PACKAGES)}")


def test_users_scripts_find_their_modules(terminal):
    terminal.run("python3 -c 'import crazyflie, uav_trajectory, pycrazyswarm; crazyflie.Crazyflie'")


@pytest.mark.parametrize("package", PACKAGES)
def test_programs_and_data_are_installed(package, install_space):
    programs = {path.name: path for path in (install_space / "lib" / package).glob("*")}
    for source in PACKAGES[package].glob("exec/*"):
        assert source.name in programs
        assert os.access(programs[source.name], os.X_OK)
        # catkin chooses the interpreter.
        assert code_of(programs[source.name]) == code_of(source)
    share = install_space / "share" / package
    for folder in ("launch", "config", "references", "rviz", "urdf", "msg", "srv"):
        for source in (PACKAGES[package] / folder).rglob("*.*"):
            installed = share / source.relative_to(PACKAGES[package])
            assert installed.read_bytes() == source.read_bytes()
