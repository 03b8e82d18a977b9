"""A recording of the present flight, and its report."""

import subprocess
import threading
from concurrent.futures import Future
from pathlib import Path
from signal import SIGINT
from typing import Any

import roslib.packages
import rospkg

from crazyflie_utils.refusal import RefusalError

_END_LIMIT = 30.0  #: Longest time for the end of the recorder (s).
_REPORT_LIMIT = 600.0  #: Longest time for the report (s).
_NICE = ("nice", "-n", "10")  #: The report has low priority: flights come first.


class Recording:
    """Starts and ends the recorder, and starts the report.

    Parameters
    ----------
    folder : Path, optional
        Folder for the recordings, each in a folder with the date; by default that of others.
    programs : callable, optional
        ``programs(name)`` returns the path of a program of crazyflie_reports.
    """

    def __init__(self, folder: Path | None = None, programs: Any = None):
        self.text = ""  #: State in words, for the page.
        self.report: Path | None = None  #: The last report, HTML.
        self._folder = folder or Path(rospkg.get_ros_home(), "flights")
        self._programs = programs or _program
        self._recorder: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Begin to record.

        Raises
        ------
        RefusalError
            A recording is running.
        """
        if self.text:
            raise RefusalError(f"record: {self.text}; end it first")
        self._folder.mkdir(parents=True, exist_ok=True)
        self._before = {*self._folder.iterdir()}
        command = [*_NICE, self._programs("record_flight"), f"--folder={self._folder}"]
        # In a session of its own: Ctrl-C at the dashboard is passed on once, by `stop`.
        self._recorder = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
        self.text = "recording"

    def stop(self) -> "Future[str]":
        """End the recording; the future is done when its report has been made.

        Raises
        ------
        RefusalError
            No recording is running.
        """
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            raise RefusalError("stop recording: this dashboard has not started a recording")
        self.text = "the report is made"
        outcome: Future[str] = Future()

        def work():
            try:
                try:
                    report = self._finish(recorder)
                finally:
                    # Before the outcome: who waits for it may record again.
                    self.text = ""
                outcome.set_result(report)
            except (OSError, ValueError, subprocess.SubprocessError, RefusalError) as error:
                outcome.set_exception(RefusalError(f"recording: {error}"))

        threading.Thread(target=work, daemon=True).start()
        return outcome

    def close(self) -> None:
        """End a recording without a report."""
        if self._recorder is not None and self._recorder.poll() is None:
            self._recorder.send_signal(SIGINT)

    def _finish(self, recorder):
        if recorder.poll() is None:
            recorder.send_signal(SIGINT)
        status = recorder.wait(_END_LIMIT)
        made = {*self._folder.iterdir()} - self._before
        if not made:
            raise ValueError(f"nothing was recorded below {self._folder}, with status {status}")
        folder = max(made, key=lambda each: each.stat().st_mtime)
        command = [*_NICE, self._programs("flight_report"), folder, "--out", folder / "report"]
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, timeout=_REPORT_LIMIT
        )
        report = folder / "report" / "report.html"
        if not report.exists():
            said = done.stderr.strip()[-500:] or f"status {done.returncode}"
            raise ValueError(f"no report on {folder}: {said}")
        self.report = report
        return str(report)


def _program(name):
    found = roslib.packages.find_node("crazyflie_reports", name)
    if not found:
        raise RefusalError(f"crazyflie_reports has no {name}; build the workspace")
    return found[0]
