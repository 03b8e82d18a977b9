"""The program that runs a mission: a dry run of it, or the flight.

    python3 -m crazyflie_mission_api.mission_runner dry_run|fly FILE [ARGUMENT...]

FILE is a script with its arguments, or a trajectory (CSV) and the names of vehicles. ``fly`` prints
each command as it begins. ``dry_run`` goes as far as ``fleet.fly(mission)``, and no vehicle moves.
Its result is a line of JSON: {"dry_run": {"passed": bool, "text": str, "duration": s, "steps":
[[s, command], ...], "paths": {vehicle: [[x, y, z], ...]}}}.
"""

import argparse
import contextlib
import json
import os
import runpy
import sys
from typing import Any

from typing_extensions import override

from crazyflie_demo import trajectory_file
from crazyflie_mission_api import Fleet, Limits, MissionError, observer
from crazyflie_mission_api.observer import NO_DRY_RUN, MissionObserver
from crazyflie_utils import ParameterError
from crazyflie_utils.text_file import user_path

_HEIGHT = 1.0  #: Height of the takeoff before a trajectory (m).
#: Limits of trajectories in files, which are flown unchanged or refused.
_LIMITS = Limits(speed=1.5, acceleration=2.5)
_PERIOD = 0.2  #: Time between two points of a displayed path (s).
_SHOWN_NAMES = 4  #: Largest number of vehicles that are named; more are counted.


class Done(BaseException):
    """Ends the script after its dry run."""


class _Printer(MissionObserver):
    """Prints commands as they begin: time (s) since the first, command, vehicles."""

    _first: float | None = None

    @override
    def begin(self, command: str, vehicles: list[str], time: float) -> None:
        self._first = time if self._first is None else self._first
        # The program that reads the output may have ended; the vehicles must still land.
        with contextlib.suppress(OSError):
            print(f"{time - self._first:7.1f} s  {_words(command, vehicles)}", flush=True)


class _DryRunReport(MissionObserver):
    """Prints the result of the first dry run, and ends the script."""

    dry_runs_only = True

    def __init__(self) -> None:
        self._paths: dict[str, list[list[float]]] = {}
        self._last = -_PERIOD
        self._warnings: list[str] = []
        self._steps: list[tuple[float, str]] = []

    @override
    def plan(self, command: str, vehicles: list[str], time: float) -> None:
        self._steps.append((round(time, 2), _words(command, vehicles)))

    @override
    def step(self, group: Any) -> None:
        if group.time() - self._last >= _PERIOD:
            self._last = group.time()
            for name in group.names:
                point = [round(each, 3) for each in group.position(name)]
                self._paths.setdefault(name, []).append(point)

    @override
    def warn(self, text: str) -> None:
        self._warnings.append(text)

    @override
    def passed(self, vehicles: list[str], duration: float) -> None:
        text = "; ".join([f"{', '.join(vehicles)} fly for {duration:.0f} s", *self._warnings])
        _print_result(True, text, duration, self._paths, self._steps)
        raise Done


def main(arguments: list[str]) -> int:
    """Fly, or make a dry run; return the exit status."""
    parser = argparse.ArgumentParser(prog="mission_runner", description=__doc__)
    parser.add_argument("word", choices=("dry_run", "fly"))
    parser.add_argument("file", help="script, or trajectory (CSV)")
    parser.add_argument(
        "others", nargs=argparse.REMAINDER, help="arguments of the script, or names of vehicles"
    )
    options = parser.parse_args(arguments)
    path, others = str(user_path(options.file)), options.others
    is_dry = options.word == "dry_run"
    if not os.path.isfile(path):
        place = os.path.abspath(path)
        parser.error(f"the file {place} does not exist; expected a script, or a trajectory (CSV)")
    observer.of_process = _DryRunReport() if is_dry else _Printer()
    # sys.argv and the path are as if the script were started directly.
    sys.argv, sys.path[0] = [path, *others], os.path.dirname(os.path.abspath(path))
    try:
        if path.endswith(".csv"):
            _fly_trajectory(path, others)
        else:
            runpy.run_path(path, run_name="__main__")
    except Done:
        return 0
    except (MissionError, ParameterError, trajectory_file.TrajectoryError) as error:
        if is_dry:
            _print_result(False, str(error))
        else:
            print(f"the mission failed: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    if is_dry:
        _print_result(False, NO_DRY_RUN)
    return int(is_dry)


def _fly_trajectory(path: str, names: list[str]) -> None:
    pieces = trajectory_file.load(path)

    def mission(group: Any) -> None:
        group.takeoff(_HEIGHT)
        group.follow(pieces, relative=True)
        group.land()

    with Fleet(names, limits=_LIMITS) as fleet:
        fleet.fly(mission)


def _words(command, vehicles):
    count = len(vehicles)
    return f"{command}: {', '.join(vehicles) if count <= _SHOWN_NAMES else f'{count} vehicles'}"


def _print_result(passed, text, duration=0.0, paths=None, steps=()):
    result = {"passed": passed, "text": text, "duration": duration, "paths": paths or {}}
    print(json.dumps({"dry_run": {**result, "steps": steps}}), flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
