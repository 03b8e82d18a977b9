"""The running vehicles, for scripts of Crazyswarm's API."""

import math
import re
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from crazyflie_fleet.high_level_services import HIGH_LEVEL
from crazyflie_fleet.vehicle_nodes import PLACE
from crazyflie_mission_api import Fleet, MissionError
from crazyflie_utils import NodeHandle
from crazyflie_utils.parameters.types import Integer

_SEARCH_LIMIT = 5.0  #: Timeout of the search for vehicles (s of the machine's clock).
_ANSWER_LIMIT = 15.0  #: Timeout of the answer to a command (s of the machine's clock).


class CommandRefusedError(RuntimeError):
    """A vehicle refuses a command, or has not answered; the text names it and the reason."""


class ScriptConnection:
    """Handle and fleet that all vehicles of a script share."""

    def __init__(self, handle: NodeHandle, fleet: Fleet, is_unchecked: bool):
        self.handle = handle
        self.fleet = fleet
        self.is_unchecked = is_unchecked  #: Whether refusals are only warnings.
        self.said: set[str] = set()  #: See `SimulatedParameters`.

    def refuse(self, text: str) -> None:
        """Raise `CommandRefusedError`; with --unchecked warn."""
        if not self.is_unchecked:
            raise CommandRefusedError(f"{text}; with --unchecked this is a warning")
        self.handle.warn(text)

    def finish(
        self,
        what: str,
        calls: Mapping[str, "Future[Any]"],
        has_begun: Callable[[str], bool] = lambda name: False,
    ) -> None:
        """Wait for the answers of calls, by name of the vehicle, or until each has begun."""
        end = time.monotonic() + _ANSWER_LIMIT

        def waiting():
            return [name for name, call in calls.items() if not call.done() and not has_begun(name)]

        self.fleet.clock.wait_until(lambda: not waiting() or time.monotonic() > end, math.inf)
        failures = {name: f"no answer for {_ANSWER_LIMIT:g} s" for name in waiting()}
        for name, call in calls.items():
            if call.done() and call.exception() is not None:
                failures[name] = str(call.exception())
        if failures:
            self.refuse("; ".join(f"{name}: {what}: {text}" for name, text in failures.items()))


def running_vehicles(handle: NodeHandle) -> list[str]:
    """Return the names of the running vehicles: in the order of their fleet file, then by number.

    Raises
    ------
    MissionError No vehicle is running.
    """
    end = time.monotonic() + _SEARCH_LIMIT
    while time.monotonic() < end:
        services = handle.service_nodes()
        tops = {_top(service) for service in services if _is_flown(service, services)}
        if names := tops - {"", "all"}:
            places = {
                name: handle.get_param(f"/{name}/{PLACE}", Integer(0, 1000), 1000) for name in names
            }
            return sorted(names, key=lambda name: (places[name], _number_key(name)))
        time.sleep(0.1)
    raise MissionError(
        f"no vehicle is running: for {_SEARCH_LIMIT:g} s there was no service "
        f"/NAME/{HIGH_LEVEL}/go_to "
        "or /NAME/upload_trajectory; expected, for example, roslaunch crazyflie_examples "
        "sw_swarm.launch, or a vehicle of crazyflie_driver; or the option --sim"
    )


def _is_flown(service, services):
    top, _, name = service.rpartition("/")
    if name == "upload_trajectory":
        return services.get(f"{top}/go_to") == services[service]
    return service.endswith(f"/{HIGH_LEVEL}/go_to")


def _top(service):
    return service.strip("/").split("/")[0] if service.count("/") > 1 else ""


def _number_key(name):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]
