"""Parser of fleet files."""

import dataclasses
import difflib
from collections import ChainMap, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from crazyflie_driver.positioning import MOCAP
from crazyflie_fleet.fleet_config import (
    DEFAULT_TOPICS,
    DYNAMICS,
    LOCAL,
    NONE,
    RESERVED_NAMES,
    VEHICLE_NAME,
    WITHOUT_EFFECT,
    BroadcastSettings,
    DefaultTopicSettings,
    FleetConfig,
    LogTopicSettings,
    MachineSettings,
    Settings,
    VehicleConfig,
    address_of,
    close_pairs,
)
from crazyflie_link.triggers import acts
from crazyflie_model.quadrotor import TYPES
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters.declaration import Complaints
from crazyflie_utils.parameters.types import BOOLEAN, FIRMWARE_NUMBER, ParameterType
from crazyflie_utils.parameters.vehicle_model import load
from crazyflie_utils.parameters.yaml_file import Entry
from crazyflie_utils.text import shortened, shown
from crazyflie_utils.text_file import user_path
from crazyflie_virtual.log import MAX_BYTES, log_variables

#: Least similarity of an unknown key to a known one that is misspelt (0 to 1).
_SIMILAR = 0.8

_TOP = ("robots", "robot_types", "all", "machines", "fence", "fileversion")
_FIRMWARE = ("firmware_params", "firmware_logging")
_LOGGING = ("enabled", "default_topics", "custom_topics")

#: Firmware variable -> its size (bytes).
_SIZES = {f"{each.group}.{each.name}": each.number_type.size for each in log_variables()}
_DECLARATIONS = [*VehicleConfig.declarations()]
_WITHOUT_EFFECT = [each.name for each in _DECLARATIONS if each.help == WITHOUT_EFFECT]
_GROUPS = {each.name.partition("/")[0] for each in _DECLARATIONS if "/" in each.name}


class Remarks:
    """Collects remarks; those on the keys of one kind become one line."""

    def __init__(self) -> None:
        self._texts: dict[object, str] = {}
        # Lines of keys.
        self._unknown: dict[str, dict[int, None]] = defaultdict(dict)
        self._idle: dict[str, dict[int, None]] = defaultdict(dict)
        self._file: object = ""

    def add(self, text: str, key: object = None) -> None:
        """Add a text, unless there is one with the same key, by default the text itself."""
        self._texts.setdefault(key or text, text)

    def unknown(self, entry: Entry, known: Iterable[str]) -> None:
        """Add an entry with an unknown key.

        `ParameterError`: the key is a misspelt known one.
        """
        key = entry.name.rpartition("/")[2]
        words = {word for name in known for word in name.split("/")}
        if meant := difflib.get_close_matches(key, words, 1, _SIMILAR):
            raise entry.error(f"is not known; expected {meant[0]}")
        self._file = entry.file
        self._unknown[key][entry.line] = None

    def idle(self, entry: Entry, key: str) -> None:
        """Add an entry with a known key that has no effect."""
        self._file = entry.file
        self._idle[key][entry.line] = None

    def texts(self) -> tuple[str, ...]:
        """Return all remarks."""
        unknown = "; ".join(_listed(*each) for each in self._unknown.items())
        texts = [f"ignored, since they are not known here: {unknown}"] if unknown else []
        texts += [f"{_listed(*each)} has no effect here" for each in self._idle.items()]
        return (*self._texts.values(), *(f"{self._file}: {text}" for text in texts))


def _listed(key, lines):
    return f"{key} (line {', '.join(map(str, lines))})"


class _Layer(NamedTuple):
    """What a vehicle, its type or ``all`` contains, by names."""

    settings: dict[str, Entry]
    firmware_params: dict[str, float]
    standard_topics: dict[str, Entry]
    log_topics: dict[str, LogTopicSettings]


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
        machines = {
            name: self._read(entry, MachineSettings)
            for name, entry in _entries(self._parts, "machines").items()
        }
        # Settings are checked where they are given: once, and not for each vehicle.
        types = {
            name: self._layer(entry) for name, entry in _entries(self._parts, "robot_types").items()
        }
        common = self._layer(self._parts.get("all"), "broadcasts")
        broadcasts = self._broadcasts(common.settings)
        fence = self._parts.get("fence")
        has_fence = fence is not None and self._check_type(BOOLEAN, fence.value, fence)
        own = {name: self._layer(entry) for name, entry in robots.items()}
        for name, entry in robots.items():
            self._check_type(VEHICLE_NAME, name, entry)
            self._check_choice(own[name], "type", types)
        for layer in (*own.values(), *types.values(), common):
            self._check_choice(layer, "machine", (LOCAL, *machines))
        self._errors.raise_any()
        # Combinations of settings are checked for each vehicle.
        vehicles = []
        for name, entry in robots.items():
            layers = [own[name], common]
            if chosen := own[name].settings.get("type"):
                layers.insert(1, types[chosen.value])
            vehicles.append(self._vehicle(name, entry, layers))
        self._errors.raise_any()
        enabled = [vehicle for vehicle in vehicles if vehicle.enabled]
        self._check_apart(enabled, robots, own)
        self._errors.raise_any()
        disabled = [vehicle.name for vehicle in vehicles if not vehicle.enabled]
        flown = [vehicle for vehicle in enabled if vehicle.connection != NONE]
        if not flown:
            raise self._parts["robots"].error(
                f"has no enabled vehicle with a connection other than {NONE}; expected at least one"
            )
        unplaced = self._unplaced(enabled)
        obstacles = tuple(vehicle for vehicle in enabled if vehicle.connection == NONE)
        return FleetConfig(
            tuple(flown),
            tuple(disabled),
            machines,
            self.remarks.texts(),
            broadcasts,
            unplaced,
            obstacles,
            has_fence,
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

    def _check_keys(self, entries, known):
        for key, entry in entries.items():
            if key not in known and not entry.is_template:
                with self._errors:
                    self.remarks.unknown(entry, known)

    def _check_type(self, expected: ParameterType, value: Any, entry: Entry) -> Any:
        try:
            return expected(value)
        except ValueError:
            self._error(entry, f"is {shown(value)}; expected {expected}")
            return None

    def _check_choice(self, layer, key, known):
        chosen = layer.settings.get(key)
        if chosen is not None and chosen.value and chosen.value not in list(known):
            names = shortened(", ".join(known))
            expected = f"one of {names}" if known else f"none, as there are no {key}s"
            self._error(chosen, f"is {shown(chosen.value)}; expected {expected}")

    def _check_apart(self, vehicles, robots, own):
        """Check that no two vehicles have one address, id, or frame of motion capture."""

        def given(name, key):
            return own[name].settings.get(key, robots[name])

        uris: dict[str, str] = {}
        ids: dict[int, str] = {}
        # Two with one frame would both fly by the pose of one body.
        frames = {vehicle.name: vehicle.name for vehicle in vehicles}
        for vehicle in vehicles:
            name, frame = vehicle.name, vehicle.mocap_frame
            if (
                vehicle.uri
                and (other := uris.setdefault(address_of(vehicle.uri).key, name)) != name
            ):
                self._error(
                    given(name, "uri"),
                    f"is {vehicle.uri}, which is also that of {other} in line "
                    f"{given(other, 'uri').line}; expected an address of its own",
                )
            if vehicle.id is not None and (other := ids.setdefault(vehicle.id, name)) != name:
                self._error(
                    given(name, "id"),
                    f"is {vehicle.id}, which is also that of {other} in line "
                    f"{given(other, 'id').line}; expected another",
                )
            if (other := frames.setdefault(frame, name)) != name:
                self._error(
                    given(name, "motion_capture/frame"),
                    f"has the frame {frame} of motion capture, which is that of {other}; expected "
                    "a frame of its own",
                )

    def _unplaced(self, vehicles):
        pairs = []
        for i, j, distance, limit in close_vehicles(vehicles):
            if vehicles[i].connection == vehicles[j].connection == NONE:
                continue
            first, second = vehicles[i].name, vehicles[j].name
            pairs.append((first, second))
            self.remarks.add(
                f"{self._top.file}: the start points of {first} and {second} are {distance:.3g} m "
                f"apart, and their collision buffers need {limit:.3g} m; neither takes off until "
                "they are measured that far apart"
            )
        return tuple(pairs)

    # Parts of the file.

    def _broadcasts(self, settings):
        if (entry := settings.get("broadcasts")) is None:
            return {}
        if (given := self._read(entry, BroadcastSettings)) is None:
            return {}
        return {
            "broadcast/repeats": given.repeats,
            "broadcast/repeat_period": given.period_ms / 1000.0,
        }

    def _layer(self, entry, *extra_keys):
        layer = _Layer({}, {}, {}, {})
        if entry is None:
            return layer
        with self._errors:
            layer.settings.update(_leaves(entry))
        if self._read(entry, Settings, *_FIRMWARE, *extra_keys) is None:
            return layer
        for name, inner in layer.settings.items():
            if name in _WITHOUT_EFFECT:
                self.remarks.idle(inner, name)
        with self._errors:
            for group, inner in _entries(layer.settings, "firmware_params").items():
                for key, value in inner.entries().items():
                    if acts(f"{group}.{key}"):
                        # Values are written whenever the vehicle is added, also in a hand.
                        text = "turns motors, arms, stops or restarts the vehicle, and is not a "
                        self._error(value, text + "setting; expected none")
                    number = self._check_type(FIRMWARE_NUMBER, value.value, value)
                    layer.firmware_params[f"{group}.{key}"] = number
            self._read_logging(_entries(layer.settings, "firmware_logging"), layer)
        return layer

    def _read_logging(self, parts, layer):
        self._check_keys(parts, _LOGGING)
        if "enabled" in parts:
            layer.settings["firmware_logging/enabled"] = parts["enabled"]
            self._check_type(BOOLEAN, parts["enabled"].value, parts["enabled"])
        default_topics = _entries(parts, "default_topics")
        self._check_keys(default_topics, DEFAULT_TOPICS)
        for key, entry in default_topics.items():
            if DEFAULT_TOPICS.get(key) == "":
                remark = entry.error("is not offered by the driver, and is ignored")
                self.remarks.add(str(remark), entry.line)
            elif key in DEFAULT_TOPICS and self._read(entry, DefaultTopicSettings) is not None:
                layer.standard_topics[DEFAULT_TOPICS[key]] = entry
                if "frequency" in entry:
                    self.remarks.idle(entry["frequency"], "frequency of a default topic")
        for name, entry in _entries(parts, "custom_topics").items():
            layer.log_topics[name] = topic = self._read(entry, LogTopicSettings)
            if topic is not None:
                self._check_size(topic.variables, entry["vars"])
            if name in RESERVED_NAMES:
                self._error(entry, "is a name of the vehicle's own topics; expected another name")
            self._check_type(VEHICLE_NAME, name, entry)

    def _check_size(self, variables, entry):
        # The vehicle refuses it, too, but only when it is added. Another firmware may have others.
        if (size := sum(_SIZES.get(each, 1) for each in variables)) > MAX_BYTES:
            text = f"takes {size} bytes or more; at most {MAX_BYTES} fit in a packet: "
            self._error(entry, text + "make it two topics")

    def _vehicle(self, name, robot, layers):
        """Return a vehicle of the layers, the nearest first."""
        settings, params, standard_topics, log_topics = map(ChainMap, *layers)

        def place(key: str) -> str:
            return f"{shortened(f'{robot.name}/{key}')} ({robot.file}:{robot.line})"

        with self._errors:
            vehicle = VehicleConfig.read(lambda key: settings[key].value, place)
            self._check_voltages(settings, vehicle)
            self._check_id(settings, vehicle)
            if vehicle.connection == NONE:
                self._check_obstacle(settings, vehicle)
            if (enabled := settings.get("firmware_logging/enabled")) and not enabled.value:
                standard_topics = log_topics = ChainMap()
            return dataclasses.replace(
                vehicle,
                name=name,
                model=self._model(settings, vehicle.model),
                firmware_params=dict(params),
                # For safety, the battery is always monitored.
                default_topics=tuple(dict.fromkeys(["battery", *standard_topics])),
                log_topics=dict(log_topics),
            )

    def _model(self, settings, model):
        """Return a model; the path of a model file is relative to this one."""
        if model in DYNAMICS or model in TYPES:
            return model
        path = str((self._top.file.parent / user_path(model)).resolve())
        try:
            load(path)
        except ParameterError as error:
            self._errors += [str(settings["model"].error(each)) for each in error.complaints]
        return path

    def _check_obstacle(self, settings, vehicle):
        if vehicle.positioning != MOCAP:
            self._error(
                settings["positioning"],
                f"is {vehicle.positioning} of a body without a connection; expected {MOCAP}",
            )
        elif vehicle.has_single_marker:
            self._error(
                settings["motion_capture/tracking"],
                f"is {vehicle.mocap_tracking} with the marker {vehicle.mocap_marker}, of a body "
                "without a connection; expected a rigid body, as one marker does not tell its yaw",
            )

    def _check_id(self, settings, vehicle):
        found = None if vehicle.uri is None else address_of(vehicle.uri).vehicle_id
        if vehicle.id is not None and found is not None and vehicle.id != found:
            self._error(
                settings["id"],
                f"is {vehicle.id}, and its address {vehicle.uri} ends with {found:02X} ({found}); "
                "expected the same number",
            )

    def _check_voltages(self, settings, vehicle):
        # Only here is it known whether each comes from the robot, its type or ``all``.
        critical, warning = vehicle.voltage_critical, vehicle.voltage_warning
        if critical <= warning:
            return
        key, text = "voltage_critical", f"not more than voltage_warning, {warning:g} (V)"
        if f"battery/{key}" not in settings:
            key, text = "voltage_warning", f"not less than voltage_critical, {critical:g} (V)"
        # Without the robot's name: an inherited error is reported once.
        entry = Entry(f"battery/{key}", settings[f"battery/{key}"].node)
        self._error(entry, f"is {getattr(vehicle, key):g}; expected {text}")


def _leaves(entry: Entry, prefix: str = "") -> Iterator[tuple[str, Entry]]:
    """Yield settings by their names, those of groups, too."""
    for key, inner in entry.entries().items():
        if key in _GROUPS and not prefix:
            yield from _leaves(inner, f"{key}/")
        else:
            yield prefix + key, inner


def _entries(parts, key):
    return parts[key].entries() if key in parts else {}


def close_vehicles(
    vehicles: Sequence[VehicleConfig],
) -> list[tuple[int, int, float, float]]:
    """Return the pairs of vehicles whose start points are too close; see `close_pairs`."""
    positions = np.array([vehicle.position for vehicle in vehicles])
    return sorted(close_pairs(positions, [vehicle.buffer for vehicle in vehicles]))
