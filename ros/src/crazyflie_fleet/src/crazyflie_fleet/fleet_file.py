"""The file that names the vehicles of a fleet, laid out as crazyswarm2's crazyflies.yaml."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from crazyflie_fleet.fleet_config import FleetConfig, LogTopic, VehicleConfig, close_pairs
from crazyflie_fleet.settings import (
    DEFAULT_TOPICS,
    LOCAL,
    VEHICLE_NAME,
    DefaultTopicSettings,
    FirmwareNumber,
    LogTopicSettings,
    MachineSettings,
    RobotSettings,
    Settings,
    same_vehicle,
)
from crazyflie_utils import ParameterError
from crazyflie_utils.messages import shortened, shown
from crazyflie_utils.parameters.types import BOOLEAN, ParameterType
from crazyflie_utils.parameters.yaml_file import Entry
from crazyflie_utils.parameters.yaml_file import load as load_yaml

FIRST_PORT = 19850
"""UDP port of a grid's first vehicle."""

_TOP = ("robots", "robot_types", "all", "machines", "fileversion")
_FIRMWARE = ("firmware_params", "firmware_logging")
_LOGGING = ("enabled", "default_topics", "custom_topics")
_FIRMWARE_NUMBER = FirmwareNumber()


def load(path: str | Path) -> FleetConfig:
    """Return the fleet that a file describes.

    Raises
    ------
    ParameterError
        About everything that is wrong: file, line, and what was expected.
    """
    return _Parser(load_yaml(path)).fleet()


def grid(n: int, spacing: float = 1.0) -> FleetConfig:
    """Return n vehicles cf1, cf2, ... in rows around the origin.

    Parameters
    ----------
    n : int
    spacing : float
        From one to the next, m.

    Raises
    ------
    ParameterError
        There is no such grid.
    """
    if n < 1:
        raise ParameterError(f"a grid of {n} vehicles; expected at least one")
    columns = math.ceil(math.sqrt(n))
    middle = (math.ceil(n / columns) - 1) / 2, (columns - 1) / 2
    vehicles = []
    for k in range(n):
        row, column = divmod(k, columns)
        position = (row - middle[0]) * spacing, (column - middle[1]) * spacing, 0.0
        settings = RobotSettings.from_mapping(
            {"initial_position": position, "uri": f"udp://127.0.0.1:{FIRST_PORT + k}"}
        )
        vehicles.append(VehicleConfig(f"cf{k + 1}", position, settings))
    for _, _, distance, limit in _close(vehicles):
        raise ParameterError(
            f"the spacing of the grid is {distance:g} m; expected at least {limit:g} m, the "
            "collision buffers of two vehicles"
        )
    return FleetConfig(tuple(vehicles))


class _Parser:
    """Parses one file; collects all errors."""

    def __init__(self, top: Entry):
        self._top = top
        self._parts = top.entries()
        self._errors: list[str] = []
        self._warnings: dict[int, str] = {}

    def fleet(self) -> FleetConfig:
        """Return the fleet, or raise `ParameterError`."""
        self._check_keys(self._parts, _TOP)
        robots = self._top["robots"].entries()
        types = _entries(self._parts, "robot_types")
        common = self._parts.get("all")
        machines = {
            name: self._read(entry, MachineSettings)
            for name, entry in _entries(self._parts, "machines").items()
        }
        # What vehicles inherit is checked where it is given: once, and not in each of them.
        for entry in types.values():
            self._check(entry, Settings)
        if common is not None:
            self._check(common, Settings, "broadcasts")
        for name, entry in robots.items():
            self._check_type(VEHICLE_NAME, name, entry)
            self._check(entry, RobotSettings)
            self._check_choice(entry, "type", types)
        for entry in (*robots.values(), *types.values(), *([common] if common else [])):
            self._check_choice(entry, "machine", (LOCAL, *machines))
        self._raise_errors()
        vehicles = [self._vehicle(name, entry, types, common) for name, entry in robots.items()]
        self._raise_errors()
        enabled = [vehicle for vehicle in vehicles if vehicle.settings.enabled]
        self._check_apart(enabled, robots)
        self._raise_errors()
        disabled = [vehicle.name for vehicle in vehicles if not vehicle.settings.enabled]
        if not enabled:
            raise self._top["robots"].error("has no vehicle that is enabled; expected one at least")
        return FleetConfig(
            tuple(enabled), tuple(disabled), machines, tuple(self._warnings.values())
        )

    # What is wrong.

    def _error(self, entry, text):
        self._errors += entry.error(text).complaints

    def _raise_errors(self):
        if self._errors:
            raise ParameterError(*dict.fromkeys(self._errors))

    def _read(self, entry, settings, *besides):
        try:
            return entry.read(settings, besides)
        except ParameterError as error:
            self._errors += error.complaints
            return None

    def _check(self, entry, settings, *besides):
        if self._read(entry, settings, *_FIRMWARE, *besides) is None:
            return
        try:
            self._firmware(entry)
        except ParameterError as error:
            self._errors += error.complaints

    def _check_keys(self, entries, known):
        for key, entry in entries.items():
            if key not in known:
                self._error(entry, f"is not known; expected one of {', '.join(known)}")

    def _check_type(self, expected: ParameterType, value: Any, entry: Entry) -> Any:
        try:
            return expected(value)
        except ValueError:
            self._error(entry, f"is {shown(value)}; expected {expected}")
            return None

    def _check_choice(self, entry, key, known):
        if isinstance(entry.node, yaml.MappingNode) and key in entry:
            chosen = entry[key]
            if chosen.value and chosen.value not in list(known):
                expected = (
                    f"one of {shortened(', '.join(known))}"
                    if known
                    else f"none, as there are no {key}s"
                )
                self._error(chosen, f"is {shown(chosen.value)}; expected {expected}")

    def _check_apart(self, vehicles, robots):
        seen: dict[str, str] = {}
        for vehicle in vehicles:
            if vehicle.uri is None:
                continue
            other = seen.setdefault(same_vehicle(vehicle.uri), vehicle.name)
            if other != vehicle.name:
                line = robots[other]["uri"].line
                self._error(
                    robots[vehicle.name]["uri"],
                    f"is {vehicle.uri}, as that of {other} in line {line}; expected an address "
                    "of its own",
                )
        for i, j, distance, limit in _close(vehicles):
            first, second = (robots[vehicles[k].name]["initial_position"] for k in (i, j))
            self._error(
                second,
                f"is {distance:.3g} m from that of {vehicles[i].name} in line {first.line}; "
                f"expected at least {limit:.3g} m, their collision buffers",
            )

    # What vehicles are.

    def _vehicle(self, name, robot, types, common):
        layers = [common, types.get(robot["type"].value) if "type" in robot else None, robot]
        node = _merged([layer.node for layer in layers if layer is not None])
        merged = Entry(robot.file, robot.name, node)
        settings = self._read(merged, RobotSettings, *_FIRMWARE, "broadcasts")
        if settings is None:
            return None
        self._check_voltages(merged, settings)
        return VehicleConfig(name, settings.position, settings, *self._firmware(merged))

    def _check_voltages(self, merged, settings):
        # Which of the robot, its type and all has which of them is known only here.
        critical, warning = settings.voltage_critical, settings.voltage_warning
        if critical <= warning:
            return
        given = merged["battery"].entries()
        if "voltage_critical" in given:
            entry, text = given["voltage_critical"], f"is {critical:g}; expected not more than"
            other = f"voltage_warning, {warning:g} (V)"
        else:
            entry, text = given["voltage_warning"], f"is {warning:g}; expected not less than"
            other = f"voltage_critical, {critical:g} (V)"
        # Without the robot's name: what several inherit is wrong once.
        name = entry.name.removeprefix(f"{merged.name}/")
        self._error(Entry(entry.file, name, entry.node), f"{text} {other}")

    def _firmware(self, entry):
        parts = entry.entries()
        params = {
            f"{group}.{key}": self._check_type(_FIRMWARE_NUMBER, value.value, value)
            for group, inner in _entries(parts, "firmware_params").items()
            for key, value in inner.entries().items()
        }
        if "firmware_logging" not in parts:
            return params, ("battery",), ()
        return params, *self._logging(parts["firmware_logging"])

    def _logging(self, entry):
        parts = entry.entries()
        self._check_keys(parts, _LOGGING)
        default_topics = _entries(parts, "default_topics")
        self._check_keys(default_topics, DEFAULT_TOPICS)
        standard = []
        for key, inner in default_topics.items():
            if DEFAULT_TOPICS.get(key) == "":
                warning = inner.error("is not offered by the driver, and left out")
                self._warnings.setdefault(inner.line, str(warning))
            elif key in DEFAULT_TOPICS and self._read(inner, DefaultTopicSettings) is not None:
                standard.append(DEFAULT_TOPICS[key])
        custom = []
        for key, inner in _entries(parts, "custom_topics").items():
            topic = self._read(inner, LogTopicSettings)
            self._check_type(VEHICLE_NAME, key, inner)
            if topic is not None:
                custom.append(LogTopic(key, topic.frequency, topic.variables))
        enabled = "enabled" not in parts or self._check_type(
            BOOLEAN, parts["enabled"].value, parts["enabled"]
        )
        # Without its battery a vehicle is not safe: it is watched in any case.
        names = ("battery", *standard) if enabled else ("battery",)
        return tuple(dict.fromkeys(names)), tuple(custom) if enabled else ()


def _entries(parts, key):
    return parts[key].entries() if key in parts else {}


def _close(vehicles):
    if not vehicles:
        return []
    positions = np.array([vehicle.position for vehicle in vehicles])
    return sorted(close_pairs(positions, [vehicle.buffer for vehicle in vehicles]))


def _merged(nodes):
    """Return a mapping with the values of all, the last one's first; each keeps its line."""
    if not all(isinstance(node, yaml.MappingNode) for node in nodes):
        return nodes[-1]
    values: dict[str, list[yaml.Node]] = {}
    keys = {}
    for node in nodes:
        for key, value in node.value:
            keys[key.value] = key
            values.setdefault(key.value, []).append(value)
    merged = [(keys[name], _merged(layers)) for name, layers in values.items()]
    last = nodes[-1]
    return yaml.MappingNode(last.tag, merged, last.start_mark, last.end_mark)
