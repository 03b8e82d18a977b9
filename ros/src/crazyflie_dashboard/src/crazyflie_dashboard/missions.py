"""Mission scripts and trajectories: their dry runs, flights and ends, each in its own process."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from pathlib import Path

from crazyflie_dashboard.page_data import (
    DryRunResult,
    MissionFile,
)
from crazyflie_utils.refusal import RefusalError

#: Flies missions, and makes dry runs; how the line with the result of a dry run begins, and what
#: a line about a command is.
_RUNNER = ("-m", "crazyflie_mission_api.mission_runner")
_RESULT = '{"dry_run": '
_COMMAND = re.compile(r" *[0-9.]+ s  (\w+: .+)")
_DRY_RUN_TIMEOUT = 60.0  #: s.
_LAND_TIMEOUT = 60.0  #: From the end of a mission that is stopped until its process is killed, s.
_MAX_OUTPUT = 2000  #: Of the text of a failure, characters.

_CRAZYSWARM = ("pycrazyswarm", "crazyflie_py")


def listed(folders: Iterable[str | Path]) -> tuple[MissionFile, ...]:
    """Return scripts and trajectories in folders, by name; folders that are missing hold none."""
    found = []
    for folder in folders:
        for path in sorted(Path(folder).expanduser().glob("*")):
            if path.suffix not in (".py", ".csv") or not path.is_file():
                continue
            text = path.read_text(errors="replace") if path.suffix == ".py" else ""
            if path.suffix == ".csv" or any(
                each in text for each in ("crazyflie_mission_api", *_CRAZYSWARM)
            ):
                found.append(MissionFile(str(path), path.name, path.suffix == ".csv"))
    return tuple(found)


class Missions:
    """The mission that flies, if there is one, and dry runs.

    Parameters
    ----------
    python : str, optional
        Interpreter.
    """

    def __init__(self, python: str = sys.executable):
        self._python = python
        self._lock = threading.Lock()
        self._flying: subprocess.Popen[str] | None = None
        self._passed: set[tuple[str, float, tuple[str, ...]]] = set()
        self._title = self._command = ""

    @property
    def running(self) -> tuple[str, ...]:
        """Titles of what flies, each with its last command if that is known."""
        with self._lock:
            if self._flying is None:
                return ()
            return (f"{self._title} {self._command}".strip(),)

    def dry_run(self, mission: MissionFile, vehicles: tuple[str, ...]) -> "Future[DryRunResult]":
        """Fly a mission with ideal vehicles."""
        result: Future[DryRunResult] = Future()
        command = [self._python, *_RUNNER, "dry_run", mission.path, *vehicles]
        if not mission.is_trajectory and _is_crazyswarm(mission.path):
            command = [self._python, mission.path, "--sim"]
        environment = _environment(vehicles) | {"CRAZYFLIE_PY_DRY_RUN": "1"}
        key = _key(mission, vehicles)

        def work():
            done = _run(command, environment, _DRY_RUN_TIMEOUT)
            if done.passed:
                with self._lock:
                    self._passed.add(key)
            result.set_result(done)

        threading.Thread(target=work, daemon=True).start()
        return result

    def fly(self, mission: MissionFile, vehicles: tuple[str, ...]) -> "Future[str]":
        """Fly a mission; the future has "" at its end, or fails with what it has said.

        Raises
        ------
        RefusalError
            Its dry run has not passed with these vehicles, it has changed since, or one flies.
        """
        end: Future[str] = Future()
        command = [self._python, *_RUNNER, "fly", mission.path, *vehicles]
        if not mission.is_trajectory and _is_crazyswarm(mission.path):
            command = [self._python, mission.path]
        with self._lock:
            if self._flying is not None:
                raise RefusalError(f"{self._title} flies; expected it to have ended, or stop it")
            if _key(mission, vehicles) not in self._passed:
                raise RefusalError(f"{mission.title}: expected a dry run of it that has passed")
            process = self._flying = _start(command, _environment(vehicles))
            self._title, self._command = mission.title, ""

        def work():
            output = ""
            for line in process.stdout:
                output = (output + line)[-_MAX_OUTPUT:]
                if match := _COMMAND.match(line):
                    self._command = match[1]
            process.wait()
            with self._lock:
                self._flying = None
            # Stopped while Python itself still started: nothing has flown.
            is_early = output.startswith("Fatal Python error: init_import_site")
            if is_early or process.returncode in (0, 130, 143, -signal.SIGINT):
                end.set_result("")
            else:
                end.set_exception(RefusalError(_last(output, process.returncode)))

        threading.Thread(target=work, daemon=True).start()
        return end

    def stop(self) -> None:
        """Have the mission that flies end and land its vehicles.

        Raises
        ------
        RefusalError
            None flies.
        """
        with self._lock:
            process = self._flying
        if process is None:
            raise RefusalError("stop: no mission flies that was begun here")
        process.send_signal(signal.SIGINT)
        killer = threading.Timer(_LAND_TIMEOUT, _kill, (process,))
        killer.daemon = True
        killer.start()


def _run(command: list[str], environment: Mapping[str, str], limit: float) -> DryRunResult:
    process = _start(command, environment)
    try:
        output, _ = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        _kill(process)
        return DryRunResult(False, f"the dry run did not end within {limit:g} s")
    for line in output.splitlines():
        if line.startswith(_RESULT):
            found = json.loads(line)["dry_run"]
            paths = tuple((name, tuple(map(tuple, path))) for name, path in found["paths"].items())
            return DryRunResult(found["passed"], found["text"], found["duration"], paths)
    if process.returncode == 0 and "--sim" in command:
        return DryRunResult(True, "flown by ideal vehicles")
    return DryRunResult(False, _last(output, process.returncode))


def _environment(vehicles):
    """Return what a script of Crazyswarm's API cannot get around by options of its own."""
    return {"CRAZYFLIE_PY_VEHICLES": ":".join(vehicles)}


def _start(command, environment):
    # In a session of its own: Ctrl-C at the dashboard must not end a flight.
    return subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
        env={**os.environ, "MPLBACKEND": "Agg", **environment},
    )


def _kill(process):
    with contextlib.suppress(OSError):
        os.killpg(process.pid, signal.SIGKILL)


def _last(output: str, status: int) -> str:
    """Return what a program has said last, which is why it has ended."""
    return output.strip()[-_MAX_OUTPUT:] or f"it has ended with status {status}"


def _is_crazyswarm(path):
    with contextlib.suppress(OSError):
        text = Path(path).read_text(errors="replace")
        return "crazyflie_mission_api" not in text and any(each in text for each in _CRAZYSWARM)
    return False


def _key(mission, vehicles):
    try:
        return mission.path, os.stat(mission.path).st_mtime, tuple(vehicles)
    except OSError as error:
        raise RefusalError(f"{mission.title}: {error.strerror}") from None
