"""The program that flies a trajectory, or makes the dry run of a mission.

    python3 -m crazyflie_mission_api.mission_runner dry_run|fly FILE VEHICLE...

A dry run is made where the script says ``fleet.fly(mission)``; nothing moves. Its last line of
output is the result as JSON: {"dry_run": {"passed": bool, "text": str, "duration": s, "paths":
{vehicle: [[x, y, z], ...]}}}.
"""

import json
import runpy
import sys
from collections.abc import Callable
from typing import Any

from crazyflie_demo import trajectory_file
from crazyflie_mission_api import Fleet, Limits, MissionError
from crazyflie_mission_api.dry_run import dry_run
from crazyflie_mission_api.vehicle_group import VehicleGroup

_HEIGHT = 1.0  #: Of a trajectory's takeoff, m.
#: Of trajectories in files: they are flown as they are, or not at all.
_LIMITS = Limits(speed=1.5, acceleration=2.5)
_PERIOD = 0.2  #: From one point of a path that is shown to the next, s.

_COMMANDS = ("takeoff", "go_to", "follow", "formation", "land", "emergency", "adopt")


class Done(BaseException):
    """The dry run has been made: the script is to go no further."""


def main(arguments: list[str]) -> int:
    """Fly, or make a dry run; return the exit status."""
    what, path, *names = arguments
    fly = (lambda fleet, mission: fleet.fly(mission)) if what == "fly" else _rehearse
    if what == "dry_run":
        _forbid_flights()
    sys.argv = [path, *names]
    try:
        if path.endswith(".csv"):
            pieces = trajectory_file.load(path)
            with Fleet(names, limits=_LIMITS) as fleet:
                fly(fleet, lambda group: _follow(group, pieces))
        else:
            runpy.run_path(path, run_name="__main__")
            _report(False, "the script does not call fleet.fly(mission): there is no dry run of it")
    except Done:
        return 0
    except (MissionError, trajectory_file.TrajectoryError) as error:
        _report(False, str(error))
        return 1
    return 0 if what == "fly" else 1


def _follow(group, pieces):
    group.takeoff(_HEIGHT)
    group.follow(pieces, relative=True)
    group.land()


def _forbid_flights():
    """Have commands to real vehicles fail, and `Fleet.fly` make the dry run only."""

    def refuse(fleet, *_, **__):
        raise MissionError("the script does not call fleet.fly(mission): there is no dry run of it")

    for name in _COMMANDS:
        setattr(Fleet, name, refuse)
    setattr(Fleet, "fly", _rehearse)  # noqa: B010


def _rehearse(fleet: Fleet, mission: Callable[[VehicleGroup], Any]) -> None:
    paths: dict[str, list[tuple[float, ...]]] = {name: [] for name in fleet.names}

    def watched(group: Any) -> None:
        wait_until, seen = group.clock.wait_until, [-_PERIOD]

        def record() -> bool:
            if group.time() - seen[0] >= _PERIOD:
                seen[0] = group.time()
                for name, path in paths.items():
                    path.append(tuple(round(each, 3) for each in group.position(name)))
            return False

        def recorded(condition: Callable[[], bool], deadline: float) -> bool:
            return wait_until(lambda: record() or condition(), deadline)

        group.clock.wait_until = recorded
        mission(group)

    duration = dry_run(fleet, watched)
    _report(True, f"passed: {', '.join(fleet.names)} fly for {duration:.0f} s", duration, paths)
    raise Done


def _report(passed, text, duration=0.0, paths=None):
    result = {"passed": passed, "text": text, "duration": duration, "paths": paths or {}}
    print(json.dumps({"dry_run": result}), flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
