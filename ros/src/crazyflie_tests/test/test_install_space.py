"""The install space has everything, and flies when there is nothing else."""

import contextlib
import os
from pathlib import Path

import pytest
from workspaces import FAST, FLY, INSTALLED, TOP, code_of, data_of, programs_of

INSPECT = Path(__file__).with_name("inspect_install.py")

# A copy of the workspace is built. The installed files are tested in test_install_rules.py; the
# commands of the installation are those by which ./run makes the workspace that is tested.
pytestmark = pytest.mark.long


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
    terminal.run(f"python3 {INSPECT} {install_space} {' '.join(INSTALLED)}")


def test_users_scripts_find_their_modules(terminal):
    terminal.run("python3 -c 'import crazyflie, uav_trajectory, pycrazyswarm; crazyflie.Crazyflie'")


@pytest.mark.parametrize("package", INSTALLED)
def test_programs_and_data_are_installed(package, install_space):
    programs = {path.name: path for path in (install_space / "lib" / package).glob("*")}
    built = [TOP / "ros" / "devel" / "lib" / package / name for name in programs_of(package)]
    for source in (*INSTALLED[package].glob("exec/*"), *built):
        assert source.name in programs
        assert os.access(programs[source.name], os.X_OK)
        # catkin chooses the interpreter.
        assert code_of(programs[source.name]) == code_of(source)
    for name, source in data_of(package):
        assert (install_space / "share" / package / name).read_bytes() == source.read_bytes()
