"""Parser of fleet files."""

import dataclasses
import difflib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import yaml

from crazyflie_fleet.fleet_config import (
    DEFAULT_TOPICS,
    DYNAMICS,
    FIRMWARE_NUMBER,
    LOCAL,
    VEHICLE_NAME,
    WITHOUT_EFFECT,
    BroadcastSettings,
    DefaultTopicSettings,
    FleetConfig,
    LogTopicSettings,
    MachineSettings,
    Settings,
    VehicleConfig,
    close_pairs,
    vehicle_key,
)
from crazyflie_model.quadrotor import TYPES
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters.declaration import Complaints
from crazyflie_utils.parameters.types import BOOLEAN, ParameterType
from crazyflie_utils.parameters.vehicle_model import load
from crazyflie_utils.parameters.yaml_file import Entry
from crazyflie_utils.text import shortened, shown

#: Least similarity of an unknown key to a known one that is misspelt (0 to 1).
_SIMILAR = 0.8

_TOP = ("robots", "robot_types", "all", "machines", "fileversion")
_FIRMWARE = ("firmware_params", "firmware_logging")
_LOGGING = ("enabled", "default_topics", "custom_topics")
_WITHOUT_EFFECT = [
    declaration.name
    for declaration in VehicleConfig.declarations()
    if declaration.help == WITHOUT_EFFECT
]


class Remarks:
    """Collects remarks; those on the keys of one kind become one line."""

    def __init__(self) -> None:
        self._texts: dict[object, str] = {}
        self._unknown: dict[str, list[int]] = {}
        self._idle: dict[str, list[int]] = {}
        self._file: object = ""

    def add(self, text: str, key: object = None) -> None:
        """Add a text, unless there is one with the same key, by default the text itself."""
        self._texts.setdefault(key or text, text)

    def unknown(self, entry: Entry, known: Iterable[str]) -> None:
        """Add an entry with an unknown key.

        Raises
        ------
        ParameterError
            The key is a misspelt known one.
        """
        key = entry.name.rpartition("/")[2]
        words = {word for name in known for word in name.split("/")}
        if meant := difflib.get_close_matches(key, words, 1, _SIMILAR):
            raise entry.error(f"is not known; expected {meant[0]}")
        self._note(self._unknown, key, entry)

    def idle(self, entry: Entry, key: str) -> None:
        """Add an entry with a known key that has no effect."""
        self._note(self._idle, key, entry)

    def texts(self) -> tuple[str, ...]:
        """Return all remarks."""
        texts = [*self._texts.values()]
        if self._unknown:
            texts.append(
                f"{self._file}: ignored, since they are not known here: {_listed(self._unknown)}"
            )
        texts += [
            f"{self._file}: {_listed({key: lines})} has no effect here"
            for key, lines in self._idle.items()
        ]
        return tuple(texts)

    def _note(self, found, key, entry):
        self._file = entry.file
        lines = found.setdefault(key, [])
        if entry.line not in lines:
            lines.append(entry.line)


def _listed(found):
    return "; ".join(f"{key} (line {', '.join(map(str, lines))})" for key, lines in found.items())


class FleetParser:
    """Parses one file in crazyswarm2's layout; collects all errors, and remarks."""

    def __init__(self, top: Entry):
        self._top = top
        self._parts = top.entries()
        self._errors = Complaints()
        self.remarks = Remarks()

    def fleet(self) -> FleetConfig:
        """Return the fleet, or raise `ParameterError`."""
        if "robots" not in self._parts:
            raise self._top.error(
                "has neither robots (crazyswarm2) nor crazyflies (Crazyswarm 1); it has "
                f"{shortened(', '.join(self._parts)) or 'nothing'}"
            )
        self._check_keys(self._parts, _TOP)
        robots = self._parts["robots"].entries()
        types = _entries(self._parts, "robot_types")
        common = self._parts.get("all")
        machines = {
            name: self._read(entry, MachineSettings)
            for name, entry in _entries(self._parts, "machines").items()
        }
        # Inherited settings are checked where they are given: once, and not for each vehicle.
        for entry in types.values():
            self._check(entry)
        if common is not None:
            self._check(common, "broadcasts")
        broadcasts = self._broadcasts(common)
        for name, entry in robots.items():
            self._check_type(VEHICLE_NAME, name, entry)
            self._check(entry)
            self._check_choice(entry, "type", types)
        for entry in (*robots.values(), *types.values(), *([common] if common else [])):
            self._check_choice(entry, "machine", (LOCAL, *machines))
        self._errors.raise_any()
        # Combinations of settings are checked for each vehicle.
        vehicles = [self._vehicle(name, entry, types, common) for name, entry in robots.items()]
        self._errors.raise_any()
        enabled = [vehicle for vehicle in vehicles if vehicle.enabled]
        self._check_apart(enabled, robots)
        self._errors.raise_any()
        disabled = [vehicle.name for vehicle in vehicles if not vehicle.enabled]
        if not enabled:
            raise self._parts["robots"].error("has no enabled vehicle; expected at least one")
        unplaced = self._unplaced(enabled)
        return FleetConfig(
            tuple(enabled), tuple(disabled), machines, self.remarks.texts(), broadcasts, unplaced
        )

    # Errors.

    def _error(self, entry, text):
        self._errors += entry.error(text).complaints

    def _read(self, entry, settings, *extra_keys):
        def on_unknown(unknown, known):
            with self._errors:
                self.remarks.unknown(unknown, known)

        with self._errors:
            return entry.read(settings, extra_keys, on_unknown)

    def _check(self, entry, *extra_keys):
        if self._read(entry, Settings, *_FIRMWARE, *extra_keys) is None:
            return
        for key in _WITHOUT_EFFECT:
            if (idle := entry_at(entry, key)) is not None:
                self.remarks.idle(idle, key)
        with self._errors:
            self._firmware(entry)

    def _broadcasts(self, common):
        if common is None or "broadcasts" not in common:
            return {}
        given = self._read(common["broadcasts"], BroadcastSettings)
        if given is None:
            return {}
        return {
            "broadcast/repeats": given.repeats,
            "broadcast/repeat_period": given.period_ms / 1000.0,
        }

    def _check_keys(self, entries, known):
        for key, entry in entries.items():
            if key not in known:
                with self._errors:
                    self.remarks.unknown(entry, known)

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
        """Check that no two vehicles have one address, or one frame of motion capture."""
        uris: dict[str, str] = {}
        # Two with one frame would both fly by the pose of one body.
        frames = {vehicle.name: vehicle.name for vehicle in vehicles}
        for vehicle in vehicles:
            name, robot, frame = vehicle.name, robots[vehicle.name], vehicle.mocap_frame
            if vehicle.uri and (other := uris.setdefault(vehicle_key(vehicle.uri), name)) != name:
                line = (entry_at(robots[other], "uri") or robots[other]).line
                self._error(
                    entry_at(robot, "uri") or robot,
                    f"is {vehicle.uri}, which is also that of {other} in line {line}; expected "
                    "an address of its own",
                )
            if (other := frames.setdefault(frame, name)) != name:
                self._error(
                    entry_at(robot, "motion_capture/frame") or robot,
                    f"has the frame {frame} of motion capture, which is that of {other}; expected "
                    "a frame of its own",
                )

    def _unplaced(self, vehicles):
        pairs = []
        for i, j, distance, limit in close_vehicles(vehicles):
            first, second = vehicles[i].name, vehicles[j].name
            pairs.append((first, second))
            self.remarks.add(
                f"{self._top.file}: the start points of {first} and {second} are {distance:.3g} m "
                f"apart, and their collision buffers need {limit:.3g} m; neither takes off until "
                "they are measured that far apart"
            )
        return tuple(pairs)

    # Vehicles.

    def _vehicle(self, name, robot, types, common):
        layers = [common, types.get(robot["type"].value) if "type" in robot else None, robot]
        node = _merged([layer.node for layer in layers if layer is not None])
        merged = Entry(robot.name, node)
        vehicle = self._read(merged, VehicleConfig, *_FIRMWARE, "broadcasts")
        if vehicle is None:
            return None
        self._check_voltages(merged, vehicle)
        model = self._model(merged, vehicle.model)
        params, default_topics, log_topics = self._firmware(merged)
        return dataclasses.replace(
            vehicle,
            name=name,
            model=model,
            firmware_params=params,
            default_topics=default_topics,
            log_topics=log_topics,
        )

    def _model(self, merged, model):
        """Return a model; the path of a model file is relative to this one."""
        if model in DYNAMICS or model in TYPES:
            return model
        path = str((self._top.file.parent / model).resolve())
        try:
            load(path)
        except ParameterError as error:
            for each in error.complaints:
                self._error(merged["model"], each)
        return path

    def _check_voltages(self, merged, settings):
        # Only here is it known whether each comes from the robot, its type or ``all``.
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
        # Without the robot's name: an inherited error is reported once.
        name = entry.name.removeprefix(f"{merged.name}/")
        self._error(Entry(name, entry.node), f"{text} {other}")

    def _firmware(self, entry):
        parts = entry.entries()
        params = {
            f"{group}.{key}": self._check_type(FIRMWARE_NUMBER, value.value, value)
            for group, inner in _entries(parts, "firmware_params").items()
            for key, value in inner.entries().items()
        }
        if "firmware_logging" not in parts:
            return params, ("battery",), {}
        return params, *self._logging(parts["firmware_logging"])

    def _logging(self, entry):
        parts = entry.entries()
        self._check_keys(parts, _LOGGING)
        default_topics = _entries(parts, "default_topics")
        self._check_keys(default_topics, DEFAULT_TOPICS)
        standard = []
        for key, inner in default_topics.items():
            if DEFAULT_TOPICS.get(key) == "":
                remark = inner.error("is not offered by the driver, and is ignored")
                self.remarks.add(str(remark), inner.line)
            elif key in DEFAULT_TOPICS and self._read(inner, DefaultTopicSettings) is not None:
                standard.append(DEFAULT_TOPICS[key])
                if "frequency" in inner:
                    self.remarks.idle(inner["frequency"], "frequency of a default topic")
        custom = {}
        for key, inner in _entries(parts, "custom_topics").items():
            topic = self._read(inner, LogTopicSettings)
            self._check_type(VEHICLE_NAME, key, inner)
            if topic is not None:
                custom[key] = topic
        enabled = "enabled" not in parts or self._check_type(
            BOOLEAN, parts["enabled"].value, parts["enabled"]
        )
        # For safety, the battery is always monitored.
        names = ("battery", *standard) if enabled else ("battery",)
        return tuple(dict.fromkeys(names)), custom if enabled else {}


def _entries(parts, key):
    return parts[key].entries() if key in parts else {}


def entry_at(entry: Entry, path: str) -> Entry | None:
    """Return the entry at a path, such as motion_capture/marker, or None."""
    for key in path.split("/"):
        if key not in entry:
            return None
        entry = entry[key]
    return entry


def close_vehicles(
    vehicles: Sequence[VehicleConfig],
) -> list[tuple[int, int, float, float]]:
    """Return the pairs of vehicles whose start points are too close; see `close_pairs`."""
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
