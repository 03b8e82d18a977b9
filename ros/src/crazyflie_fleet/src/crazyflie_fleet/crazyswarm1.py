"""Crazyswarm 1's crazyflies.yaml and crazyflieTypes.yaml in the layout of crazyswarm2's.

https://crazyswarm.readthedocs.io/en/latest/configuration.html
"""

from collections.abc import Iterator, Mapping

import yaml

from crazyflie_fleet.settings import SINGLE_MARKER
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters.types import Integer
from crazyflie_utils.parameters.yaml_file import Entry

VEHICLES, TYPES = "crazyflies", "crazyflieTypes"  #: Keys at the top of the two files.

_TYPE_KEYS = {
    "bigQuad": ("big_quad",),
    "batteryVoltageWarning": ("battery", "voltage_warning"),
    # So it is spelt in their file.
    "batteryVoltateCritical": ("battery", "voltage_critical"),
    "batteryVoltageCritical": ("battery", "voltage_critical"),
    "markerConfiguration": ("motion_capture", "marker"),
    "dynamicsConfiguration": ("motion_capture", "dynamics"),
    "firmwareParams": ("firmware_params",),
}
_ID = Integer(0, 255)
_CHANNEL = Integer(0, 125)


def converted(vehicles: Entry, types: Entry | None) -> Entry:
    """Return both files as crazyswarm2 lays out one; values keep their file and line.

    Vehicle k is named cfk; its address is radio://0/CHANNEL/2M/E7E7E7E7 and k with two hexadecimal
    digits. One without a channel has no address. Without ``types`` no vehicle has a type.

    Raises
    ------
    ParameterError
        A vehicle has no id, or another's.
    """
    robots: dict[str, yaml.Node] = {}
    errors: list[str] = []
    for entry in vehicles[VEHICLES].elements():
        try:
            name, node = _robot(entry, types is not None)
            if name in robots:
                line = robots[name].start_mark.line + 1
                raise entry["id"].error(f"is that of {name} in line {line}; expected another")
            robots[name] = node
        except ParameterError as error:
            errors += error.complaints
    if errors:
        raise ParameterError(*errors)
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
    number = _number(entry["id"], _ID)
    parts = {key: value.node for key, value in entry.entries().items()}
    place = parts.pop("id")
    if "channel" in parts:
        channel = _number(entry["channel"], _CHANNEL)
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
    """Return the number of points of a marker configuration; 0 if there is none."""
    entry = types
    for key in ("markerConfigurations", configuration, "points"):
        if key not in entry:
            return 0
        entry = entry[key]
    return len(entry.entries())


def _number(entry: Entry, expected: Integer) -> int:
    try:
        return expected(entry.value)
    except ValueError:
        raise entry.error(f"is {entry.value!r}; expected {expected}") from None


def _mapping(parts: Mapping[str, yaml.Node], place: yaml.Node) -> yaml.MappingNode:
    def pairs() -> Iterator[tuple[yaml.Node, yaml.Node]]:
        for key, node in parts.items():
            yield _text(key, node), node

    return yaml.MappingNode("tag:yaml.org,2002:map", [*pairs()], place.start_mark, place.end_mark)


def _text(value: str, place: yaml.Node) -> yaml.ScalarNode:
    return yaml.ScalarNode("tag:yaml.org,2002:str", value, place.start_mark, place.end_mark)
