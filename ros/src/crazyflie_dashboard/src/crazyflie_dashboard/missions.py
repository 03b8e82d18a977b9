"""Mission scripts and trajectories: their dry runs, flights and ends, each in its own process."""

import contextlib
import json
import math
import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import rospkg

from crazyflie_dashboard.page_data import DryRunResult
from crazyflie_dashboard.snapshot import Step, Triple
from crazyflie_utils.refusal import RefusalError

#: Program that flies missions and dry runs; the beginning of the line with a dry run's result, and
#: the pattern of a line about a command.
_RUNNER = ("-m", "crazyflie_mission_api.mission_runner")
_RESULT = '{"dry_run": '
_COMMAND = re.compile(r" *[0-9.]+ s  (\w+: .+)")
_DRY_RUN_TIMEOUT = 60.0  #: s.
_LAND_TIMEOUT = 60.0  #: Time from the stop of a mission until its process is killed (s).
_MAX_OUTPUT = 2000  #: Largest length of the text of a failure (characters).

_POLL = 0.2  #: Period in which the output of a mission is read (s).
_MAX_DISTANCE = 0.2  #: Distance that vehicles may have moved since the dry run (m).
_SOURCES = (".py", ".csv", ".yaml", ".yml")  #: Suffixes of files that a script may read.

#: APIs of missions; scripts of the others, which are Crazyswarm's, fly without the runner.
_OWN_API = "crazyflie_mission_api"
_APIS = (_OWN_API, "pycrazyswarm", "crazyflie_py")


def listed(folders: Iterable[str | Path]) -> tuple[Path, ...]:
    """Return scripts and trajectories in folders, by name; folders that are missing hold none."""
    return tuple(
        path
        for folder in folders
        for path in sorted(Path(folder).expanduser().glob("*"))
        # Path.is_file raises the errors of a link that cannot be followed.
        if os.path.isfile(path) and (path.suffix == ".csv" or _apis(path))
    )


class MissionFlight:
    """A mission in a process of its own, which goes on without this one.

    Its output is a file. The file ``record`` identifies the process: its number alone may belong to
    another one by now.

    `OSError`, `ValueError`, `KeyError`: it does not fly any more, or belongs to another master.
    """

    def __init__(self, record: Path):
        known = json.loads(record.read_text())
        self.title: str = known["title"]
        self.command = ""  #: The last one.
        self._begun, self._since = 0, time.monotonic()  # Count of its commands; begin of the last.
        self.is_stopped: bool = known["is_stopped"]
        self.said = ""  #: The end of its output.
        #: Its process if it is a child of this one.
        self.child: subprocess.Popen[Any] | None = None
        self._record, self._known, self._pid = record, known, known["pid"]
        # From here on the process number cannot be reused.
        self._process = os.pidfd_open(self._pid)
        if known["began"] != _began(self._pid) or known["master"] != _master():
            os.close(self._process)
            raise ProcessLookupError

    @staticmethod
    def begin(
        folder: Path,
        title: str,
        command: list[str],
        environment: Mapping[str, str],
        dry_run: DryRunResult | None = None,
    ) -> "MissionFlight":
        """Start a mission, whose dry run may be known, with its files in a folder."""
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.out"):
            if not old.with_suffix(".json").exists():
                old.unlink(missing_ok=True)
        started = folder / f"starting_{os.getpid()}"
        with started.open("w") as output:
            process = _start(command, environment, output)
        record = folder / f"{process.pid}.json"
        started.rename(record.with_suffix(".out"))
        duration, steps = (dry_run.duration, dry_run.steps) if dry_run else (None, ())
        known = {"title": title, "pid": process.pid, "began": _began(process.pid), "steps": steps}
        known["duration"] = duration
        record.write_text(json.dumps({**known, "master": _master(), "is_stopped": False}))
        flight = MissionFlight(record)
        flight.child = process
        return flight

    @property
    def text(self) -> str:
        """Its title, the time that is left, and its last command, as far as they are known."""
        took, left = time.monotonic() - self._since, ""
        if steps := self.steps:
            rest = sum(each.duration for each in steps if each.state == "next")
            now = sum(each.duration for each in steps if each.state == "now")
            left = f"{rest + max(0.0, now - took):.0f} s left"
        return " · ".join(filter(None, (self.title, left, self.command)))

    @property
    def steps(self) -> tuple[Step, ...]:
        """Its commands, by the dry run."""
        steps, last = self._known.get("steps", ()), self._known.get("duration") or 0.0
        begins = [begin for begin, _ in steps]
        states = ("done", "now", "next")
        return tuple(
            Step(
                text, max(0.0, end - begin), states[(k > self._begun - 1) + (k >= self._begun - 1)]
            )
            for k, ((begin, text), end) in enumerate(zip(steps, [*begins[1:], last], strict=True))
        )

    def wait(self) -> int:
        """Wait for its end; return its exit status, or 0 if another process started it."""
        with self._record.with_suffix(".out").open(errors="replace") as output:
            has_ended = False
            while not has_ended:
                has_ended = self._has_ended(_POLL)
                for line in output:
                    self.said = (self.said + line)[-_MAX_OUTPUT:]
                    if match := _COMMAND.match(line):
                        self.command, self._begun = match[1], self._begun + 1
                        self._since = time.monotonic()
        status = 0 if self.child is None else self.child.wait()
        self._record.unlink(missing_ok=True)
        return status

    def stop(self) -> None:
        """Land its vehicles; kill it if it does not end.

        `RefusalError`: it is landing already: a second signal would interrupt that.
        """
        if self.is_stopped:
            raise RefusalError(
                f"stop: {self.title} was stopped before, and its vehicles are landing"
            )
        self.is_stopped = self._known["is_stopped"] = True
        self._record.write_text(json.dumps(self._known))
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(self._process, signal.SIGINT)
        self.limit()

    def limit(self) -> None:
        """Kill it if it does not end in time."""

        def kill():
            # While the process lives, its number is that of the group.
            if not self._has_ended(0.0):
                _kill(self._pid)

        killer = threading.Timer(_LAND_TIMEOUT, kill)
        killer.daemon = True
        killer.start()

    def _has_ended(self, limit):
        poll = select.poll()
        poll.register(self._process, select.POLLIN)
        return bool(poll.poll(limit * 1000))


class Missions:
    """Running missions, including those that an earlier dashboard started, and dry runs.

    ``python`` is the interpreter; records and outputs are in the folder, by default in ROS's own.
    """

    def __init__(self, python: str = sys.executable, folder: Path | None = None):
        self._python = python
        self._folder = folder or Path(rospkg.get_ros_home()) / "crazyflie_missions"
        self._lock = threading.Lock()
        self._flights: list[MissionFlight] = []
        self._passed: dict[tuple[Any, ...], tuple[Mapping[str, Triple], DryRunResult]] = {}
        for record in self._folder.glob("*.json"):
            try:
                flight = MissionFlight(record)
            except (OSError, ValueError, KeyError):
                continue
            self._follow(flight, lambda status: None)
            if flight.is_stopped:
                flight.limit()

    @property
    def running(self) -> tuple[str, ...]:
        """Running missions as texts, see `MissionFlight.text`."""
        with self._lock:
            return tuple(each.text for each in self._flights)

    @property
    def steps(self) -> tuple[Step, ...]:
        """The commands of the first of them."""
        with self._lock:
            return next((each.steps for each in self._flights), ())

    def dry_run(
        self, mission: Path, vehicles: tuple[str, ...], places: Mapping[str, Triple]
    ) -> "Future[DryRunResult]":
        """Fly a mission with ideal vehicles; ``places`` (m) are where the real ones are."""
        result: Future[DryRunResult] = Future()
        command = self._command("dry_run", mission, vehicles)
        environment = _environment(vehicles) | {"CRAZYFLIE_PY_DRY_RUN": "1"}
        key = _key(mission, vehicles)

        def work():
            try:
                done = _run(command, environment, _DRY_RUN_TIMEOUT)
            except OSError as error:
                result.set_exception(error)
                return
            if done.passed:
                with self._lock:
                    self._passed[key] = dict(places), done
            result.set_result(done)

        threading.Thread(target=work, daemon=True).start()
        return result

    def fly(
        self, mission: Path, vehicles: tuple[str, ...], places: Mapping[str, Triple]
    ) -> "Future[str]":
        """Fly a mission; the future has "" at its end, or fails with its last output.

        `RefusalError`: its dry run has not passed with these vehicles, they have moved, its files
        have changed since, or another mission flies.
        """
        end: Future[str] = Future()
        command = self._command("fly", mission, vehicles)
        with self._lock:
            if self._flights:
                title = self._flights[0].title
                raise RefusalError(f"{title} is still flying; wait for its end, or stop it")
            before, dry_run = self._passed.get(_key(mission, vehicles), (None, None))
            if before is None:
                raise RefusalError(f"{mission.name}: expected a dry run of it that has passed")
            for name, place in before.items():
                if math.dist(place, places.get(name, (math.inf,) * 3)) > _MAX_DISTANCE:
                    raise RefusalError(
                        f"{mission.name}: {name} is not where it was at the dry run; expected "
                        "another one"
                    )
        environment = _environment(vehicles)
        flight = MissionFlight.begin(self._folder, mission.name, command, environment, dry_run)

        def finish(status):
            # Stopped while Python itself was starting: nothing has flown.
            is_early = flight.said.startswith("Fatal Python error: init_import_site")
            if is_early or status in (0, 130, 143, -signal.SIGINT):
                end.set_result("")
            else:
                end.set_exception(RefusalError(_last(flight.said, status)))

        self._follow(flight, finish)
        return end

    def stop(self) -> None:
        """End the running missions; they land their vehicles.

        `RefusalError`: no mission flies, or all of them are landing already.
        """
        with self._lock:
            flights = [each for each in self._flights if not each.is_stopped] or self._flights[:1]
        if not flights:
            raise RefusalError("stop: no mission that a dashboard has started is flying")
        for flight in flights:
            flight.stop()

    def _command(self, what, mission, vehicles):
        apis = _apis(mission)
        if apis and _OWN_API not in apis:
            return [self._python, str(mission), *(["--sim"] if what == "dry_run" else [])]
        return [self._python, *_RUNNER, what, str(mission), *vehicles]

    def _follow(self, flight: MissionFlight, finish: Callable[[int], None]) -> None:
        with self._lock:
            self._flights.append(flight)

        def work():
            status = flight.wait()
            with self._lock:
                self._flights.remove(flight)
            finish(status)

        threading.Thread(target=work, daemon=True).start()


def _began(pid: int) -> int:
    """Return the start time of a process, in ticks since the computer's start."""
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])


def _master():
    return os.environ.get("ROS_MASTER_URI", "")


def _run(command: list[str], environment: Mapping[str, str], limit: float) -> DryRunResult:
    process = _start(command, environment, subprocess.PIPE)
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        _kill(process.pid)
        return DryRunResult(False, f"the dry run did not end within {limit:g} s")
    for line in output.splitlines():
        if line.startswith(_RESULT):
            try:
                found = json.loads(line)["dry_run"]
            except ValueError:
                return DryRunResult(False, f"its result is damaged: {line[:_MAX_OUTPUT]}")
            paths = {name: tuple(map(tuple, path)) for name, path in found["paths"].items()}
            steps = tuple(map(tuple, found.get("steps", ())))
            return DryRunResult(found["passed"], found["text"], paths, found.get("duration"), steps)
    if process.returncode == 0 and "--sim" in command:
        return DryRunResult(True, "flown by ideal vehicles")
    return DryRunResult(False, _last(output, process.returncode))


def _environment(vehicles):
    """Return options that a script of Crazyswarm's API cannot override."""
    return {"CRAZYFLIE_PY_VEHICLES": ":".join(vehicles)}


def _start(command: list[str], environment: Mapping[str, str], output: Any) -> Any:
    # In a session of its own: Ctrl-C at the dashboard must not end a flight.
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
        env={**os.environ, "MPLBACKEND": "Agg", **environment},
    )


def _kill(group):
    with contextlib.suppress(OSError):
        os.killpg(group, signal.SIGKILL)


def _last(output: str, status: int) -> str:
    """Return the last output of a program, which is the reason why it has ended."""
    return output.strip()[-_MAX_OUTPUT:] or f"it has ended with status {status}"


def _apis(path):
    """Return the APIs that a script names; none if it cannot be read, or is a trajectory."""
    with contextlib.suppress(OSError):
        text = path.read_text(errors="replace") if path.suffix == ".py" else ""
        return [api for api in _APIS if api in text]
    return []


def _key(mission: Path, vehicles: tuple[str, ...]) -> tuple[Any, ...]:
    """Return a value that changes with a mission, its vehicles, and the files in its folder."""
    try:
        # An editor's lock is a link to nowhere.
        others = [f for f in mission.parent.iterdir() if f.suffix in _SOURCES and os.path.isfile(f)]
        times = [(str(f), f.stat().st_mtime_ns) for f in {mission, *others}]
    except OSError as error:
        raise RefusalError(f"{mission.name}: {error.strerror}") from None
    return mission, tuple(sorted(times)), vehicles
