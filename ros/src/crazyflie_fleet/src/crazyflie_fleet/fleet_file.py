"""The file that names the vehicles of a fleet, laid out as one of Crazyswarm 1 or crazyswarm2."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import yaml

from crazyflie_fleet.fleet_config import SINGLE_MARKER, FleetConfig, VehicleConfig
from crazyflie_fleet.fleet_parser import FleetParser, close_vehicles
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import Complaints
from crazyflie_utils.parameters.types import Integer
from crazyflie_utils.parameters.yaml_file import Entry
from crazyflie_utils.text_file import user_path
from crazyflie_virtual.settings import FIRST_PORT

VEHICLES, TYPES = "crazyflies", "crazyflieTypes"  #: Keys at the top of the two files.

_TYPE_KEYS = {
    "bigQuad": ("big_quad",),
    "batteryVoltageWarning": ("battery", "voltage_warning"),
    # Spelt like this in Crazyswarm 1's files.
    "batteryVoltateCritical": ("battery", "voltage_critical"),
    "batteryVoltageCritical": ("battery", "voltage_critical"),
    "markerConfiguration": ("motion_capture", "marker"),
    "dynamicsConfiguration": ("motion_capture", "dynamics"),
    "firmwareParams": ("firmware_params",),
}
_ID = Integer(0, 255)
_CHANNEL = Integer(0, 125)

TYPES_FILE = "crazyflieTypes.yaml"  #: Name of Crazyswarm 1's second file, in the same folder.


def converted(vehicles: Entry, types: Entry | None) -> Entry:
    """Return both files as crazyswarm2 lays out one; values keep their file and line.

    Vehicle k is named cfk; its address is radio://0/CHANNEL/2M/E7E7E7E7 and k with two hexadecimal
    digits. One without a channel has no address. Without ``types`` no vehicle has a type.
    `ParameterError`: a vehicle has no id, or that of another one.
    """
    robots: dict[str, yaml.Node] = {}
    errors = Complaints()
    for entry in vehicles[VEHICLES].elements():
        with errors:
            name, node = _robot(entry, types is not None)
            if name in robots:
                line = robots[name].start_mark.line + 1
                raise entry["id"].error(f"is also that of {name} in line {line}; expected another")
            robots[name] = node
    errors.raise_any()
    top = vehicles.node
    parts = {key: entry.node for key, entry in vehicles.entries().items() if key != VEHICLES}
    parts["robots"] = _mapping(robots, vehicles[VEHICLES].node)
    if types is not None:
        parts["robot_types"] = _mapping(
            {name: _type(entry, types) for name, entry in types[TYPES].entries().items()},
            types[TYPES].node,
        )
    return Entry("", _mapping(parts, top))


def _robot(entry, has_types):
    number = entry["id"].checked(_ID)
    parts = {key: value.node for key, value in entry.entries().items()}
    place = parts.pop("id")
    if "channel" in parts:
        channel = entry["channel"].checked(_CHANNEL)
        parts["uri"] = _text(f"radio://0/{channel}/2M/E7E7E7E7{number:02X}", place)
        del parts["channel"]
    if not has_types:
        parts.pop("type", None)
    if "initialPosition" in parts:
        parts["initial_position"] = parts.pop("initialPosition")
    return f"cf{number}", _mapping(parts, entry.node)


def _type(entry, types):
    parts: dict[tuple[str, ...], yaml.Node] = {
        _TYPE_KEYS.get(key, (key,)): value.node for key, value in entry.entries().items()
    }
    for key in ("marker", "dynamics"):
        path: tuple[str, ...] = ("motion_capture", key)
        if path in parts:
            parts[path] = _text(str(parts[path].value), parts[path])
    marker = parts.get(("motion_capture", "marker"))
    if marker is not None and _points(types, marker.value) == 1:
        parts["motion_capture", "tracking"] = _text(SINGLE_MARKER, marker)
    groups: dict[str, dict[str, yaml.Node]] = {}
    for keys, node in parts.items():
        if len(keys) == 2:
            groups.setdefault(keys[0], {})[keys[1]] = node
    single = {keys[0]: node for keys, node in parts.items() if len(keys) == 1}
    nested = {group: _mapping(inner, entry.node) for group, inner in groups.items()}
    return _mapping({**single, **nested}, entry.node)


def _points(types, configuration):
    """Return the number of points of a marker configuration; 0 without one."""
    entry = types
    for key in ("markerConfigurations", configuration, "points"):
        if key not in entry:
            return 0
        entry = entry[key]
    return len(entry.entries())


def _mapping(parts: Mapping[str, yaml.Node], place: yaml.Node) -> yaml.MappingNode:
    def pairs() -> Iterator[tuple[yaml.Node, yaml.Node]]:
        for key, node in parts.items():
            yield _text(key, node), node

    return yaml.MappingNode("tag:yaml.org,2002:map", [*pairs()], place.start_mark, place.end_mark)


def _text(value: str, place: yaml.Node) -> yaml.ScalarNode:
    return yaml.ScalarNode("tag:yaml.org,2002:str", value, place.start_mark, place.end_mark)


def load(path: str | Path) -> FleetConfig:
    """Return the fleet that a file describes.

    A file in Crazyswarm 1's layout has its types in `TYPES_FILE` in the same folder.
    `ParameterError` names all errors: file, line, and what was expected.
    """
    types = user_path(path).parent / TYPES_FILE
    return _fleet(yaml_file.load(path), types if types.exists() else None)


def parse(text: str, name: str = "crazyflies.yaml") -> FleetConfig:
    """Return the fleet that a YAML text describes, in either layout; ``name`` is for errors.

    `ParameterError`: as `load`.
    """
    return _fleet(yaml_file.parse(text, name), None)


def _fleet(top, types):
    if VEHICLES not in top:
        return FleetParser(top).fleet()
    parts = None if types is None else yaml_file.load(types)
    parser = FleetParser(converted(top, parts))
    if types is None and any("type" in each for each in top[VEHICLES].elements()):
        parser.remarks.add(f"{top.file}: there is no {TYPES_FILE} next to it; types have no effect")
    return parser.fleet()


def grid(n: int, spacing: float = 1.0) -> FleetConfig:
    """Return n vehicles cf1, cf2, ... in rows around the origin; ``spacing`` is in m.

    `ParameterError`: the grid is not possible.
    """
    if n < 1:
        raise ParameterError(f"a grid of {n} vehicles; expected at least one")
    columns = math.ceil(math.sqrt(n))
    middle = (math.ceil(n / columns) - 1) / 2, (columns - 1) / 2
    vehicles = []
    for k in range(n):
        row, column = divmod(k, columns)
        position = (row - middle[0]) * spacing, (column - middle[1]) * spacing, 0.0
        vehicle = VehicleConfig.from_mapping(
            {"initial_position": position, "uri": f"udp://127.0.0.1:{FIRST_PORT + k}"}
        )
        vehicles.append(replace(vehicle, name=f"cf{k + 1}"))
    for _, _, distance, limit in close_vehicles(vehicles):
        raise ParameterError(
            f"the spacing of the grid is {distance:g} m; expected at least {limit:g} m, the "
            "collision buffers of two vehicles"
        )
    return FleetConfig(tuple(vehicles))
