"""A recording of the present flight, earlier ones, and reports on them."""

import re
import subprocess
import threading
import time
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from signal import SIGINT
from typing import Any

import roslib.packages
import rospkg

from crazyflie_utils.refusal import RefusalError

_END_LIMIT = 30.0  #: Longest time for the end of the recorder (s).
_REPORT_LIMIT = 600.0  #: Longest time for the report (s).
_NICE = ("nice", "-n", "10")  #: The report has low priority: flights come first.

_PARAMETERS = "parameters.yaml"  #: Written when a recording begins.
_COMPARED = "compared"  #: Folder of reports on two recordings.
#: A vehicle in the parameters: each of a fleet has its place.
_VEHICLE = re.compile(r"^([\w-]+):\n(?:  .*\n)*?  place_in_fleet:", re.MULTILINE)
_SIZE_PERIOD = 1.0  #: Period in which the size of a recording is looked up (s).


@dataclass(frozen=True)
class Recorded:
    """A recording in the folder of recordings."""

    name: str  #: Of its folder, which is the time of its begin.
    length: float  #: s.
    size: int  #: Bytes.
    vehicles: tuple[str, ...]  #: Those of a fleet; others are known to the report only.
    has_report: bool


class Recording:
    """Starts and ends the recorder, and makes reports.

    Each is in a folder with its date below ``folder``, by default that of others;
    ``programs(name)`` returns the path of a program of crazyflie_reports.
    """

    def __init__(self, folder: Path | None = None, programs: Any = None):
        self.text = ""  #: State in words, for the page.
        self.report: Path | None = None  #: The last report, HTML.
        self._folder = folder or Path(rospkg.get_ros_home(), "flights")
        self._programs = programs or _program
        self._recorder: subprocess.Popen[bytes] | None = None
        self._begun = self._sized_at = 0.0
        self._size = 0

    @property
    def length(self) -> str:
        """Time and size of the recording that runs, as a text; "" without one."""
        if self._recorder is None:
            return ""
        now = time.monotonic()
        if now - self._sized_at >= _SIZE_PERIOD:
            made = {*self._folder.iterdir()} - self._before
            self._size, self._sized_at = sum(map(_size, made)), now
        seconds = int(now - self._begun)
        return f"{seconds // 60}:{seconds % 60:02}, {self._size / 1e6:.1f} MB"

    def known(self) -> tuple[Recorded, ...]:
        """Return the recordings that have ended, the newest first."""
        found = []
        folders = self._folder.iterdir() if self._folder.is_dir() else ()
        for folder in sorted(folders, reverse=True):
            bags = [*folder.glob("*.bag")]
            if not bags:
                continue
            start = folder / _PARAMETERS
            times = [each.stat().st_mtime for each in (*bags, *([start] if start.exists() else []))]
            text = start.read_text(errors="replace") if start.exists() else ""
            names = tuple(_VEHICLE.findall(text))
            report = (folder / "report" / "report.html").exists()
            size = sum(each.stat().st_size for each in bags)
            found.append(Recorded(folder.name, max(times) - min(times), size, names, report))
        return tuple(found)

    def report_on(self, names: Sequence[str]) -> Path | None:
        """Return the report on one of the recordings, or on two of them; None without one."""
        folder = self._report_folder(names)
        report = None if folder is None else folder / "report.html"
        return report if report is not None and report.exists() else None

    def make_report(self, names: Sequence[str]) -> str:
        """Make a report on one recording, or on two laid over each other; wait for it.

        `RefusalError`: there is no such recording, or no report on it.
        """
        folder = self._report_folder(names)
        if folder is None:
            known = ", ".join(each.name for each in self.known()) or "none"
            raise RefusalError(f"report: {', '.join(names)}; expected one or two of: {known}")
        try:
            return self._make([self._folder / name for name in names], folder)
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            raise RefusalError(f"report: {error}") from None

    def _report_folder(self, names):
        known = {each.name for each in self.known()}
        if not 1 <= len(names) <= 2 or not {*names} <= known:
            return None
        if len(names) == 1:
            return self._folder / names[0] / "report"
        return self._folder / _COMPARED / "_and_".join(names)

    def start(self) -> None:
        """Begin to record.

        `RefusalError`: a recording is running.
        """
        if self.text:
            raise RefusalError(f"record: {self.text}; end it first")
        self._folder.mkdir(parents=True, exist_ok=True)
        self._before = {*self._folder.iterdir()}
        command = [*_NICE, self._programs("record_flight"), f"--folder={self._folder}"]
        # In a session of its own: Ctrl-C at the dashboard is passed on once, by `stop`.
        self._recorder = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
        self._begun, self.text = time.monotonic(), "recording"

    def stop(self) -> "Future[str]":
        """End the recording; the future is done when its report has been made.

        `RefusalError`: no recording is running.
        """
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            raise RefusalError("stop recording: this dashboard has not started a recording")
        self.text = "the report is being made"
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
        report = self._make([folder], folder / "report")
        self.report = Path(report)
        return report

    def _make(self, recordings, out):
        command = [*_NICE, self._programs("flight_report"), *recordings, "--out", out]
        command += ["--compare"] * (len(recordings) > 1)
        done = subprocess.run(
            list(map(str, command)), capture_output=True, text=True, timeout=_REPORT_LIMIT
        )
        report = out / "report.html"
        if not report.exists():
            said = done.stderr.strip()[-500:] or f"status {done.returncode}"
            raise ValueError(f"no report on {', '.join(map(str, recordings))}: {said}")
        return str(report)


def _size(folder):
    return sum(each.stat().st_size for each in folder.glob("*") if each.is_file())


def _program(name):
    found = roslib.packages.find_node("crazyflie_reports", name)
    if not found:
        raise RefusalError(f"crazyflie_reports has no {name}; build the workspace")
    return found[0]
