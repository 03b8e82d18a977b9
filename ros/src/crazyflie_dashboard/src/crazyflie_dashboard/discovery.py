"""Finds the vehicles of a graph by topics and services, and the commands that they accept."""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from std_srvs.srv import Empty, SetBool

from crazyflie_dashboard.snapshot import Action
from crazyflie_driver import srv
from crazyflie_reports.bag_topics import ROLES, VEHICLE, namespace_of

#: Topics in addition to the roles of recordings: names below the vehicle's namespace, and types.
_STATUS = {
    "flight_status": (
        rf"in_flight{VEHICLE}_flight_status|flight_status",
        "crazyflie_msgs/FlightStatus",
    ),
    "filter_status": (
        rf"in_flight{VEHICLE}_filter_status|filter_status",
        "crazyflie_msgs/FilterStatus",
    ),
    "vehicle_status": (r"vehicle_status", "crazyflie_msgs/VehicleStatus"),
}

#: Last names of namespaces that have services of vehicles but are not vehicles.
_NO_VEHICLES = {"all", "high_level"}


@dataclass(frozen=True)
class Service:
    """A service of a type (class), which carries out an action.

    With ``needs_commander`` the vehicle has no `HighLevelNode` for it yet, which must be started.
    """

    name: str
    kind: Any
    needs_commander: bool = False


@dataclass(frozen=True)
class Graph:
    """Topics and services of the graph, by the master.

    ``topics`` and ``types`` are topic -> type, of published topics and of all topics; ``services``
    service -> its node.
    """

    topics: Mapping[str, str] = field(default_factory=dict)
    types: Mapping[str, str] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class FoundVehicle:
    """A vehicle on the graph."""

    namespace: str  #: Absolute, without a slash at its end: "" or /cf1.
    driver: str = ""  #: Namespace of its driver, which differs in the hardware example.
    topics: Mapping[str, tuple[str, str]] = field(default_factory=dict)  #: Role -> topic and type.
    services: Mapping[Action, Service] = field(default_factory=dict)
    emergencies: tuple[str, ...] = ()  #: Services that stop its motors, all of which are called.
    has_driver: bool = False  #: Whether a driver connects it.

    @property
    def name(self) -> str:
        """Without a slash in front; "/" without a namespace."""
        return self.namespace.strip("/") or "/"

    @cached_property
    def actions(self) -> frozenset[Action]:
        """Commands that it accepts."""
        return frozenset({*self.services, *([Action.EMERGENCY] if self.emergencies else [])})


def vehicles(graph: Graph) -> list[FoundVehicle]:
    """Return the vehicles of a graph, cf10 after cf9.

    A vehicle is a namespace with states, controls, or the status of a driver; without any, one with
    poses.
    """
    topics = _by_namespace(graph.topics)

    def having(*roles):
        return {name for name, found in topics.items() if any(role in found for role in roles)}

    flown, driven = having("state", "final_control"), having("cmd_vel", "vehicle_status", "battery")
    driven |= {
        name.removesuffix("/upload_trajectory")
        for name in graph.services
        if name.endswith("/upload_trajectory") and name.split("/")[-2] not in _NO_VEHICLES
    }
    # In the hardware example only the driver has a namespace.
    is_shared = flown == {""} and len(driven - {""}) == 1
    drivers = {"": next(iter(driven - {""}))} if is_shared else {}
    namespaces = flown if is_shared else flown | driven
    namespaces = namespaces or having("pose")
    driven |= drivers.keys()
    # Once for all vehicles: a fleet of 100 has thousands of services.
    names = _by_vehicle(graph.services)
    return [
        _vehicle(each, drivers.get(each, each), topics, graph.services, names, each in driven)
        for each in sorted(namespaces, key=_natural)
    ]


def _natural(name):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def _by_namespace(topics: Mapping[str, str]) -> dict[str, dict[str, tuple[str, str]]]:
    """Return role -> topic and type, by namespace."""
    found: dict[str, dict[str, tuple[str, str]]] = defaultdict(dict)
    known = [(role.name, f"(?:{role.topics}){VEHICLE}", set(role.rows)) for role in ROLES]
    known += [(role, names, {kind}) for role, (names, kind) in _STATUS.items()]
    for topic, kind in sorted(topics.items()):
        for role, names, kinds in known:
            if kind in kinds and (namespace := namespace_of(topic, names)) is not None:
                found[namespace and f"/{namespace}"].setdefault(role, (topic, kind))
    return found


#: Services that launch files of vehicles by remapped topics name as these: /takeoffHY4.
_NAMED = rf"(?:takeoff|land|emergency|emergency_reset){VEHICLE}"


def _by_vehicle(services: Mapping[str, str]) -> dict[str, str]:
    """Return services by the names that they would have in their vehicle's namespace."""
    found = {name: name for name in services}
    for name in services:
        if vehicle := namespace_of(name, _NAMED):
            plain = name.rpartition("/")[2].removesuffix(vehicle.rpartition("/")[2]).rstrip("_")
            found.setdefault(f"/{vehicle}/{plain}", name)
    return found


def _vehicle(top, driver, topics, services, names, has_driver):
    merged = {**topics.get(driver, {}), **topics.get(top, {})}
    found: dict[Action, Service] = {}
    for action, service in _candidates(top, driver, services):
        if service.name in names:
            found.setdefault(action, replace(service, name=names[service.name]))
    if Action.GO_TO not in found and {f"{top}/takeoff", f"{top}/land"} <= services.keys():
        found[Action.GO_TO] = Service(f"{top}/high_level/go_to", srv.GoTo, needs_commander=True)
    stops = dict.fromkeys((f"{top}/emergency", f"{driver}/emergency"))
    emergencies = tuple(names[name] for name in stops if name in names)
    return FoundVehicle(top, driver, merged, found, emergencies, has_driver)


def _candidates(
    top: str, driver: str, services: Mapping[str, str]
) -> Iterator[tuple[Action, Service]]:
    """Yield services that carry out an action, the best first."""
    commander = f"{top}/high_level"
    flights: list[tuple[str, Any, Any]] = [(commander, srv.Takeoff, srv.Land)]
    node = services.get(f"{driver}/upload_trajectory")
    is_flown_by_driver = node is not None and services.get(f"{driver}/takeoff") == node
    if is_flown_by_driver:
        flights.append((driver, srv.Takeoff, srv.Land))
    if not is_flown_by_driver or driver != top:
        flights.append((top, Empty, Empty))
    for place, takeoff, land in flights:
        yield Action.TAKEOFF, Service(f"{place}/takeoff", takeoff)
        yield Action.LAND, Service(f"{place}/land", land)
        yield Action.GO_TO, Service(f"{place}/go_to", srv.GoTo)
        yield Action.HOLD, Service(f"{place}/go_to", srv.GoTo)
    yield Action.RESET, Service(f"{top}/emergency_reset", Empty)
    yield Action.REBOOT, Service(f"{driver}/reboot", Empty)
    yield Action.RECOVER, Service(f"{driver}/recover", Empty)
    yield Action.IDENTIFY, Service(f"{driver}/update_params", srv.UpdateParams)
    yield Action.ARM, Service(f"{driver}/arm", SetBool)
    yield Action.DISARM, Service(f"{driver}/arm", SetBool)
