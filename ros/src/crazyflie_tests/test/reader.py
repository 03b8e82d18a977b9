"""Somebody who does what a page of the manual says."""

import subprocess
import time
from pathlib import Path

import rosgraph
from pages import Block, Page
from terminal import Terminal
from workspaces import BUILD_LIMIT, clean_environment

START_LIMIT = 120.0
"""The longest that anything may take to appear, s."""


class Reader:
    """Reads a page and types its commands.

    Parameters
    ----------
    top : Path
        Top folder of the repository.
    home : Path
    """

    def __init__(self, top: Path, home: Path):
        self._top = top
        self._environment = clean_environment(home)
        self._opening: str | None = None
        self._terminals: list[Terminal] = []
        self._applied: list[str] = []

    def follow(self, page: Page) -> None:
        """Do all that the page says, and end what goes on then."""
        for part in page.parts:
            if isinstance(part, Block) and part.comment.startswith("run"):
                self._type(part.commands, part.comment.partition("until ")[2])
            elif isinstance(part, Block) and part.comment == "apply":
                self._apply(part.text)
            elif part == "end":
                self.end()
            elif isinstance(part, str) and part.startswith("every shell: "):
                self._opening = part.removeprefix("every shell: ")
        self.end()

    def end(self) -> None:
        """Press Ctrl-C wherever something runs, the last one first."""
        for terminal in reversed(self._terminals):
            if terminal.is_busy:
                terminal.interrupt()

    def close(self) -> None:
        """Close all terminals, and take back the changes that the page has applied."""
        for terminal in reversed(self._terminals):
            terminal.close()
        while self._applied:
            self._git_apply(self._applied.pop(), "--reverse")

    def _apply(self, change):
        self._git_apply(change)
        self._applied.append(change)

    def _git_apply(self, change, *options):
        result = subprocess.run(
            ["git", "apply", *options],
            cwd=self._top,
            input=change + "\n",
            capture_output=True,
            text=True,
            timeout=START_LIMIT,
        )
        assert result.returncode == 0, f"{result.stderr}\n{change}"

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
