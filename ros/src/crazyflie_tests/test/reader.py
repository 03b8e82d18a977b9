"""Follows a page of the manual: types its commands, applies its changes, compares outputs."""

import re
import subprocess
import time
from pathlib import Path

import rosgraph
from pages import Block, Page
from terminal import Terminal
from workspaces import BUILD_LIMIT, clean_environment

START_LIMIT = 120.0
"""The longest that anything may take to appear, s."""

_PRINTS = "it prints "
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


def lines_of(text: str) -> list[str]:
    """Return the lines of a text as one sees them: no colours, no empty lines.

    A progress bar is overwritten by what follows it in its line.
    """
    lines = [line.rstrip().rpartition("\r")[2] for line in _COLOURS.sub("", text).split("\n")]
    return [line for line in lines if line]


def is_printed(excerpt: str, output: str) -> bool:
    """Tell whether lines stand together in an output.

    A line "..." stands for any lines, "..." in a line for any part of it.
    """
    pattern = "^"
    for line in lines_of(excerpt):
        part = ".*".join(map(re.escape, line.split("...")))
        pattern += "(?:.*\n)*?" if line == "..." else f"{part}\n"
    return re.search(pattern, "\n".join([*lines_of(output), ""]), re.MULTILINE) is not None


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
        self._printed = ""

    def follow(self, page: Page) -> None:
        """Do all that the page says, and end what goes on then.

        Its changes are applied before its first command, so that one build has all of them.
        """
        for block in page.blocks:
            if block.comment == "apply":
                self._apply(block.text)
        for part in page.parts:
            if isinstance(part, Block) and part.comment.startswith("run"):
                self._type(part.commands, part.comment.partition("until ")[2])
            elif isinstance(part, Block) and part.comment == "prints":
                assert is_printed(part.text, self._printed), f"{part.text}\n\n{self._printed}"
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
        self._printed = ""
        for command in commands[:-1] if awaited else commands:
            self._printed += _below_the_command(terminal.run(command, BUILD_LIMIT))
        if not awaited:
            return
        terminal.start(commands[-1])
        if awaited.startswith(_PRINTS):
            self._wait_for_text(awaited.removeprefix(_PRINTS), terminal)
            terminal.interrupt()
        else:
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

    def _wait_for_text(self, text, terminal):
        end = time.monotonic() + START_LIMIT
        while text not in _below_the_command(terminal.output):
            assert terminal.is_busy, f"it has ended\n{terminal.output}"
            assert time.monotonic() < end, f"it does not print {text!r}\n{terminal.output}"
            terminal.read(0.2)
        self._printed = _below_the_command(terminal.output)

    def _has(self, name):
        master = rosgraph.Master("/reader", self._environment["ROS_MASTER_URI"])
        if not master.is_online():
            return False
        published, _, services = master.getSystemState()
        return name in {name for name, _ in published + services}


def _below_the_command(output):
    return output.partition("\n")[2]
