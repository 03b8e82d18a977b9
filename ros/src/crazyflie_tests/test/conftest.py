"""Fixtures of this folder: workspaces that are built once, and shells."""

import pytest
import workspaces
from pages import Page
from reader import Reader


def pytest_collection_modifyitems(items):
    """Put the pages last: tests behind them would build the workspace without their changes."""
    items.sort(key=lambda item: item.path.name == "test_commands.py")


@pytest.fixture(scope="session")
def home(tmp_path_factory):
    """Return a home of one's own."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture(scope="session")
def workspace(tmp_path_factory, home):
    """Return the top of a copy of this repository, built and installed as the manual says."""
    top = workspaces.copy(tmp_path_factory.mktemp("workspace") / "crazyflie")
    reader = Reader(top, home)
    try:
        reader.follow(Page(workspaces.INSTALLATION))
    finally:
        reader.close()
    return top


@pytest.fixture
def install_space(workspace):
    """Return the install space of the copy."""
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
