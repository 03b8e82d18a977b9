"""Runs a mission script and prints each command to its vehicles as it begins."""

import functools
import runpy
import sys

import crazyflie_mission_api
from crazyflie_utils import ParameterError

_COMMANDS = ("takeoff", "go_to", "follow", "formation", "wait", "land", "emergency")

_SHOWN_NAMES = 4
"""More vehicles than these are counted, not named."""


class AnnouncingFleet(crazyflie_mission_api.Fleet):
    """A fleet that prints its commands: time (s) since the first, command, vehicles."""

    # Of all subgroups: they are copies. A command may be made of others, which are not printed.
    _is_busy = False
    _first: float | None = None

    def announce(self, command: str) -> None:
        """Print a command."""
        now = self.time()
        if AnnouncingFleet._first is None:
            AnnouncingFleet._first = now
        count = len(self.names)
        who = ", ".join(self.names) if count <= _SHOWN_NAMES else f"{count} vehicles"
        print(f"{now - AnnouncingFleet._first:7.1f} s  {command}: {who}", flush=True)


def _announced(name):
    command = getattr(crazyflie_mission_api.Fleet, name)

    @functools.wraps(command)
    def announced(self, *arguments, **options):
        if AnnouncingFleet._is_busy:
            return command(self, *arguments, **options)
        self.announce(name)
        AnnouncingFleet._is_busy = True
        try:
            return command(self, *arguments, **options)
        finally:
            AnnouncingFleet._is_busy = False

    return announced


for _name in _COMMANDS:
    setattr(AnnouncingFleet, _name, _announced(_name))


def main() -> int:
    """Run the script that the command line names, with the arguments behind it."""
    crazyflie_mission_api.Fleet = AnnouncingFleet  # type: ignore[misc]
    sys.argv = sys.argv[1:]
    try:
        runpy.run_path(sys.argv[0], run_name="__main__")
    except (crazyflie_mission_api.MissionError, ParameterError) as error:
        print(f"the mission failed: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
