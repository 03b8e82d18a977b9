"""Observer of a user's mission: the program that runs the mission follows and restricts it."""

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

from crazyflie_mission_api.limits import MissionError

_Method = TypeVar("_Method", bound=Callable[..., Any])

NO_DRY_RUN = "the script does not call fleet.fly(mission): there is no dry run of it"


class MissionObserver:
    """Is called at each command of fleets; does nothing itself."""

    #: Whether fleets refuse every command, and `Fleet.fly` only makes its dry run.
    dry_runs_only = False
    is_busy = False  #: Whether a command is carried out; its parts are not reported.

    def begin(self, command: str, vehicles: list[str], time: float) -> None:
        """Process the beginning of a command to vehicles, at their time (s)."""

    def plan(self, command: str, vehicles: list[str], time: float) -> None:
        """Process the beginning of a command of a dry run, at its time (s)."""

    def step(self, group: Any) -> None:
        """Process a time step of a dry run; ``group`` is its `DryRun`."""

    def warn(self, text: str) -> None:
        """Process what a dry run has found that is not an error."""

    def passed(self, vehicles: list[str], duration: float) -> None:
        """Process the end of a dry run by `Fleet.fly`, which took a duration (s)."""

    def check(self) -> None:
        """Raise MissionError if vehicles must not be commanded."""
        if self.dry_runs_only:
            raise MissionError(NO_DRY_RUN)


of_process = MissionObserver()  #: The observer of each `Fleet` that is made from now on.


def command(method: _Method) -> _Method:
    """Wrap a method so that the observer of its group is called before it."""

    @functools.wraps(method)
    def observed(group: Any, *arguments: Any, **options: Any) -> Any:
        observer = group.observer
        observer.check()
        if observer.is_busy:
            return method(group, *arguments, **options)
        observer.is_busy = True
        try:
            observer.begin(method.__name__, group.names, group.time())
            return method(group, *arguments, **options)
        finally:
            observer.is_busy = False

    return cast(_Method, observed)
