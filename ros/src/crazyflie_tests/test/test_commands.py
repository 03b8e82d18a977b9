"""The commands of the manual do what the manual says, typed as they stand into terminals."""

import re
import time
from pathlib import Path

import pytest
import rosgraph
from pages import PAGES, Block, Page
from terminal import Terminal
from workspaces import BUILD_LIMIT, TOP, clean_environment

START_LIMIT = 60.0
"""The longest that anything may take to appear, s."""

PAGES_WITH_COMMANDS = [
    path for path in PAGES if any(block.comment.startswith("run") for block in Page(path).blocks)
]


class Reader:
    """Somebody who reads a page and types its commands.

    Parameters
    ----------
    top : Path
        Top folder of the repository.
    home : Path
    """

    def __init__(self, top: Path, home: Path):
        self._top = top
        self._environment = clean_environment(home)
        self._opening = None
        self._terminals = []

    def follow(self, page: Page) -> None:
        """Do all that the page says."""
        for part in page.parts:
            if isinstance(part, Block) and part.comment.startswith("run"):
                self._type(part.commands, part.comment.partition("until ")[2])
            elif part == "end":
                self.end()
            elif isinstance(part, str) and part.startswith("every shell: "):
                self._opening = part.removeprefix("every shell: ")

    def end(self) -> None:
        """Press Ctrl-C wherever something runs, the last one first."""
        for terminal in reversed(self._terminals):
            if terminal.is_busy:
                terminal.interrupt()

    def close(self) -> None:
        """Close all terminals."""
        for terminal in reversed(self._terminals):
            terminal.close()

    def _type(self, commands, awaited):
        terminal = next((t for t in self._terminals if not t.is_busy), None) or self._open()
        for command in commands[:-1] if awaited else commands:
            terminal.run(command, BUILD_LIMIT)
        if awaited:
            terminal.start(commands[-1])
            self._wait_for(awaited, terminal)

    def _open(self):
        self._terminals.append(Terminal(self._top, self._environment))
        if self._opening:
            self._terminals[-1].run(self._opening, BUILD_LIMIT)
        return self._terminals[-1]

    def _wait_for(self, name, terminal):
        end = time.monotonic() + START_LIMIT
        while not self._has(name):
            assert terminal.is_busy, f"it has ended\n{terminal.output}"
            assert time.monotonic() < end, f"there is no {name}\n{terminal.output}"
            terminal.read(0.2)

    def _has(self, name):
        master = rosgraph.Master("/reader", self._environment["ROS_MASTER_URI"])
        if not master.is_online():
            return False
        published, _, services = master.getSystemState()
        return name in {name for name, _ in published + services}


@pytest.mark.parametrize("path", PAGES_WITH_COMMANDS, ids=lambda path: path.name)
def test_commands_of_a_page(path, workspace, tmp_path):
    reader = Reader(workspace, tmp_path / "home")
    try:
        reader.follow(Page(workspace / path.relative_to(TOP)))
        reader.end()
    finally:
        reader.close()


def test_the_picture_of_the_graph_shows_the_graph_that_runs(workspace):
    # Whatever graphviz has drawn anew when the page of the graph was tested.
    drawn = workspace / "docs" / "images" / "sw_hover_graph.svg"
    shipped = TOP / "docs" / "images" / "sw_hover_graph.svg"
    titles = [re.findall("<title>(.*)</title>", path.read_text()) for path in (drawn, shipped)]
    assert sorted(titles[0]) == sorted(titles[1])
