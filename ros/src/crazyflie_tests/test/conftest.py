"""What the tests of this folder share: workspaces that are built once, and shells."""

import pytest
import workspaces


@pytest.fixture(scope="session")
def home(tmp_path_factory):
    """Return a home of one's own."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture(scope="session")
def workspace(tmp_path_factory, home):
    """Return the top of a copy of this repository, built."""
    top = workspaces.copy(tmp_path_factory.mktemp("workspace") / "crazyflie")
    terminal = workspaces.shell(top, home)
    try:
        terminal.run("./run build", workspaces.BUILD_LIMIT)
    finally:
        terminal.close()
    return top


@pytest.fixture(scope="session")
def install_space(workspace, home):
    """Return an install space of the copy."""
    terminal = workspaces.shell(workspace / "ros", home)
    try:
        terminal.run("catkin_make install", workspaces.BUILD_LIMIT)
    finally:
        terminal.close()
    return workspace / "ros" / "install"


@pytest.fixture
def shell(home):
    """Return a function that opens shells in a folder; they are closed afterwards."""
    opened = []

    def open_in(folder):
        opened.append(workspaces.shell(folder, home))
        return opened[-1]

    yield open_in
    for terminal in opened:
        terminal.close()
