"""A shell on a terminal of its own, used as a person uses one."""

import os
import pty
import re
import select
import signal
import subprocess
import time

_STATUS = re.compile(r"status=(\d+)\r?\n")

_INTERRUPT = "\x03"

_INTERRUPT_LIMIT = 30.0
"""How long a command may take to end after Ctrl-C, s."""


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

    def __init__(self, folder, environment: dict):
        self._terminal, other_end = pty.openpty()
        # Without line editing, and with a prompt that says nothing, the output is
        # what the commands print and an echo of what is typed.
        self._shell = subprocess.Popen(
            ["bash", "--norc", "--noediting", "-i"],
            stdin=other_end,
            stdout=other_end,
            stderr=other_end,
            cwd=folder,
            env={**environment, "TERM": "dumb", "PS1": "", "PS2": ""},
            start_new_session=True,
        )
        os.close(other_end)
        self._output = ""
        self._begin = 0
        self.is_busy = False

    @property
    def output(self) -> str:
        """What the last command has printed so far."""
        return self._output[self._begin :]

    def run(self, command: str, limit: float = 60.0) -> str:
        """Type a command, wait for its end and return what it printed.

        Raises
        ------
        CommandError
            Its status is not 0, or it has not ended within ``limit`` seconds.
        """
        self.start(command)
        self._ask_for_status()
        end = time.monotonic() + limit
        while not (match := _STATUS.search(self._output, self._begin)):
            if time.monotonic() > end:
                raise CommandError(f"{command!r} has not ended after {limit:g} s\n{self.output}")
            self.read(0.1)
        self.is_busy = False
        printed = self._output[self._begin : match.start()]
        if match.group(1) != "0":
            raise CommandError(f"{command!r} ended with status {match.group(1)}\n{printed}")
        return printed

    def start(self, command: str) -> None:
        """Type a command that goes on until `interrupt`."""
        if self.is_busy:
            raise CommandError(f"cannot type {command!r}: the last command goes on")
        self._begin = len(self._output)
        self.is_busy = True
        self._type(command + "\n")

    def interrupt(self) -> None:
        """Press Ctrl-C and wait for the end of the command."""
        self._type(_INTERRUPT)
        self._ask_for_status()
        end = time.monotonic() + _INTERRUPT_LIMIT
        while not _STATUS.search(self._output, self._begin):
            if time.monotonic() > end:
                raise CommandError(f"Ctrl-C did not end it\n{self.output}")
            self.read(0.1)
        self.is_busy = False

    def close(self) -> None:
        """End the shell, and with it what still runs in it."""
        if self.is_busy:
            try:
                self.interrupt()
            except CommandError:
                self._kill()
        self._shell.send_signal(signal.SIGHUP)
        try:
            self._shell.wait(5.0)
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
            raise CommandError(f"the shell has ended\n{self.output}") from None

    def _ask_for_status(self):
        # In two words, so that the echo of the question is no answer.
        self._type('echo "status""=$?"\n')

    def _type(self, text):
        os.write(self._terminal, text.encode())

    def _kill(self):
        # Every job of an interactive shell is a process group of its own.
        session = os.getsid(self._shell.pid)
        listed = subprocess.run(
            ["ps", "-o", "pid=", "-s", str(session)], capture_output=True, text=True, check=False
        )
        for pid in map(int, listed.stdout.split()):
            if pid != self._shell.pid:
                os.kill(pid, signal.SIGKILL)
