"""A simulated vehicle: roslaunch in a process of its own, on the master that runs."""

import os
import signal
import subprocess
import time

END_LIMIT = 15.0  #: How long, in s, roslaunch has to end its nodes; then they are killed.


class VehicleProcess:
    """A vehicle that is started when the object is made.

    Parameters
    ----------
    arguments : list of str
        Of roslaunch.
    """

    def __init__(self, arguments: list[str]):
        # A session of its own: its nodes get no Ctrl-C but that of `end`, and are killed together.
        self._process = subprocess.Popen(
            ["roslaunch", *arguments], stdin=subprocess.DEVNULL, start_new_session=True
        )
        self._deadline: float | None = None

    @property
    def status(self) -> int | None:
        """Exit status of roslaunch, None while it runs; it is killed if `end` had no effect."""
        status = self._process.poll()
        if status is None and self._deadline is not None and time.monotonic() > self._deadline:
            os.killpg(self._process.pid, signal.SIGKILL)
            status = self._process.wait()
        return status

    def end(self) -> None:
        """Have the vehicle end, without waiting for it."""
        if self._deadline is None and self._process.poll() is None:
            self._deadline = time.monotonic() + END_LIMIT
            self._process.send_signal(signal.SIGINT)
