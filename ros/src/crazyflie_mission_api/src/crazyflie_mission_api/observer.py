"""What the program that runs a user's mission is told of it, and allows it."""

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

from crazyflie_mission_api.limits import MissionError

_Method = TypeVar("_Method", bound=Callable[..., Any])

NO_DRY_RUN = "the script does not call fleet.fly(mission): there is no dry run of it"


class MissionObserver:
    """Is called at each command of fleets; does nothing itself."""

    dry_runs_only = False  #: Fleets refuse every command; `Fleet.fly` makes its dry run.
    command = ""  #: The command that is carried out; those that it is made of are not told.

    def begin(self, command: str, vehicles: list[str], time: float) -> None:
        """Hear that a command to vehicles begins, at their time (s)."""

    def end(self, command: str, vehicles: list[str], time: float) -> None:
        """Hear that a command has ended or failed."""

    def step(self, group: Any) -> None:
        """Hear that time passes in a dry run, of a `DryRun`."""

    def passed(self, vehicles: list[str], duration: float) -> None:
        """Hear that `Fleet.fly` has made a dry run, which took a duration (s)."""

    def check(self) -> None:
        """Raise MissionError if vehicles must not be commanded."""
        if self.dry_runs_only:
            raise MissionError(NO_DRY_RUN)


of_process = MissionObserver()  #: The observer of each `Fleet` that is made from now on.


def command(method: _Method) -> _Method:
    """Have the observer of a group called before and after a method."""
    name = method.__name__

    @functools.wraps(method)
    def observed(group: Any, *arguments: Any, **options: Any) -> Any:
        observer = group.observer
        observer.check()
        if observer.command:
            return method(group, *arguments, **options)
        observer.command = name
        try:
            observer.begin(name, group.names, group.time())
            return method(group, *arguments, **options)
        finally:
            observer.command = ""
            observer.end(name, group.names, group.time())

    return cast(_Method, observed)
