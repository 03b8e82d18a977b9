"""The vehicles of a fleet file, in Crazyswarm's layout or crazyswarm2's."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from crazyflie_model.angles import Triple
from crazyflie_py import arguments as check
from crazyflie_utils.messages import shown

_PLACES = ("../launch/crazyflies.yaml", "../config/crazyflies.yaml")
"""Where Crazyswarm and crazyswarm2 have the file, from the script's folder."""

_SUFFIXES = (".yaml", ".yml")
"""A text that ends so is the name of a file."""


class FleetVehicle(NamedTuple):
    """A vehicle.

    Attributes
    ----------
    name : str
    id : int
        Last byte of the radio address.
    position : tuple, 3 components
        Before takeoff, m.
    buffer : float
        Radius of the space that is the vehicle's own, m.
    """

    name: str
    id: int
    position: Triple
    buffer: float = 0.15


def load(crazyflies_yaml: str | Path | None) -> list[FleetVehicle]:
    """Return the vehicles of a file, or of a text in YAML; without either, of the usual file.

    Raises
    ------
    FileNotFoundError, ValueError
        The message says what was expected.
    """
    if crazyflies_yaml is None:
        crazyflies_yaml = _usual_file()
    is_text = isinstance(crazyflies_yaml, str) and not crazyflies_yaml.endswith(_SUFFIXES)
    where = "crazyflies_yaml" if is_text else str(crazyflies_yaml)
    text = str(crazyflies_yaml) if is_text else Path(crazyflies_yaml).read_text()
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"{where} is no YAML: {error}") from None
    vehicles = _vehicles(where, content)
    ids = [vehicle.id for vehicle in vehicles]
    for vehicle_id in ids:
        if ids.count(vehicle_id) > 1:
            names = ", ".join(v.name for v in vehicles if v.id == vehicle_id)
            raise ValueError(f"{where}: {names} have one id, {vehicle_id}; expected different ids")
    return vehicles


def _usual_file():
    script = Path(sys.argv[0]).parent
    places = [folder / place for place in _PLACES for folder in (Path(), script)]
    for path in places:
        if path.is_file():
            return path
    raise FileNotFoundError(
        f"there is no fleet file: none of {', '.join(map(str, dict.fromkeys(places)))}; "
        "expected one there, or the argument crazyflies_yaml of Crazyswarm"
    )


def _vehicles(where: str, content: Any) -> list[FleetVehicle]:
    if isinstance(content, Mapping) and isinstance(content.get("crazyflies"), list):
        found = [_from_crazyswarm(where, entry) for entry in content["crazyflies"]]
    elif isinstance(content, Mapping) and isinstance(content.get("robots"), Mapping):
        robots = [_from_robot(where, *robot) for robot in content["robots"].items()]
        found = [robot for robot in robots if robot is not None]
    else:
        raise ValueError(
            f"{where} is {shown(content)}; expected a list crazyflies of channel, id, "
            "initialPosition and type, or a mapping robots: name -> uri, initial_position, ..."
        )
    if not found:
        raise ValueError(f"{where} has no vehicle that is enabled; expected one at least")
    return found


def _from_crazyswarm(where, entry):
    if not isinstance(entry, Mapping) or not {"id", "initialPosition"} <= set(entry):
        raise ValueError(
            f"{where}: an entry of crazyflies is {shown(entry)}; expected id and initialPosition"
        )
    number = check.integer(where, "id", entry["id"], 0, 255)
    position = check.triple(where, f"initialPosition of id {number}", entry["initialPosition"])
    return FleetVehicle(f"cf{number}", number, position)


def _from_robot(where, name, entry):
    if not isinstance(entry, Mapping):
        raise ValueError(f"{where}: {name} is {shown(entry)}; expected a mapping")
    if not entry.get("enabled", True):
        return None
    uri = str(entry.get("uri", ""))
    try:
        number = int(uri.split("?")[0][-2:], 16)
    except ValueError:
        raise ValueError(
            f"{where}: uri of {name} is {shown(uri)}; expected radio://0/80/2M/E7E7E7E7E7 or "
            "another whose last two characters are the id, hexadecimal"
        ) from None
    position = check.triple(where, f"initial_position of {name}", entry.get("initial_position"))
    return FleetVehicle(str(name), number, position)
