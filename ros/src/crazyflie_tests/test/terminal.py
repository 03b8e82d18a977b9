"""A shell on a terminal of its own, used as a person uses one."""

import contextlib
import os
import pty
import re
import select
import signal
import subprocess
import time
from pathlib import Path

_PROMPT = re.compile(r"\[status (\d+)\]\r?\n")
"""The shell's prompt, with the status of the last command."""

_PROMPT_SETTINGS = {"PROMPT_COMMAND": 'echo "[status $?]"', "PS1": "", "PS2": "", "TERM": "dumb"}
"""They are inherited by a shell that is started in the shell."""

_INTERRUPT = "\x03"

_SHELL_LIMIT = 60.0
"""How long a shell may take to start, and a command to end after Ctrl-C, s."""


class CommandError(Exception):
    """A command failed, or has not ended in time; the text holds its output."""


class Terminal:
    """An interactive bash.

    Parameters
    ----------
    folder : Path
        Where it starts.
    environment : dict
        All of its environment variables.
    """

    def __init__(self, folder: Path, environment: dict[str, str]):
        self._terminal, other_end = pty.openpty()
        self._shell = subprocess.Popen(
            ["bash", "--norc", "--noediting", "-i"],
            stdin=other_end,
            stdout=other_end,
            stderr=other_end,
            cwd=folder,
            env={**environment, **_PROMPT_SETTINGS},
            start_new_session=True,
        )
        os.close(other_end)
        self._output = ""
        self._wait_for_prompt("the shell did not start", _SHELL_LIMIT)

    @property
    def output(self) -> str:
        """Output of the last command so far, below the typed text."""
        return self._output

    @property
    def is_busy(self) -> bool:
        """Whether the last command goes on, as far as has been read."""
        return not _PROMPT.search(self._output)

    def run(self, command: str, limit: float = 60.0) -> str:
        """Type a command, wait for its end and return what it printed.

        Raises
        ------
        CommandError
            Its status is not 0, or it has not ended within ``limit`` seconds.
        """
        self.start(command)
        prompt = self._wait_for_prompt(f"{command!r} has not ended", limit)
        printed = self._output[: prompt.start()]
        if prompt.group(1) != "0":
            raise CommandError(f"{command!r} ended with status {prompt.group(1)}\n{printed}")
        return printed

    def start(self, command: str) -> None:
        """Type a command that goes on until `interrupt`."""
        if self.is_busy:
            raise CommandError(f"cannot type {command!r}: the last command goes on")
        self._output = ""
        self._type(command + "\n")

    def interrupt(self) -> None:
        """Press Ctrl-C and wait for the end of the command, which must have begun."""
        self._type(_INTERRUPT)
        self._wait_for_prompt("Ctrl-C did not end it", _SHELL_LIMIT)

    def close(self) -> None:
        """End the shell, and with it what still runs in it."""
        if self.is_busy:
            try:
                self.interrupt()
            except CommandError:
                self._kill_jobs()
        self._shell.send_signal(signal.SIGHUP)
        try:
            self._shell.wait(_SHELL_LIMIT)
        except subprocess.TimeoutExpired:
            self._shell.kill()
            self._shell.wait()
        os.close(self._terminal)

    def read(self, limit: float) -> None:
        """Take in what is printed next, for at most ``limit`` seconds."""
        if not select.select([self._terminal], [], [], limit)[0]:
            return
        try:
            self._output += os.read(self._terminal, 65536).decode(errors="replace")
        except OSError:
            raise CommandError(f"the shell has ended\n{self._output}") from None

    def _wait_for_prompt(self, complaint, limit):
        end = time.monotonic() + limit
        while not (prompt := _PROMPT.search(self._output)):
            if time.monotonic() > end:
                raise CommandError(f"{complaint} after {limit:g} s\n{self._output}")
            self.read(0.1)
        return prompt

    def _type(self, text):
        os.write(self._terminal, text.encode())

    def _kill_jobs(self):
        # Every job of an interactive shell is a process group of its own, in one session.
        for path in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                _, _, _, session, *_ = path.read_text().rpartition(")")[2].split()
                pid = int(path.parent.name)
                if int(session) == self._shell.pid != pid:
                    os.kill(pid, signal.SIGKILL)
