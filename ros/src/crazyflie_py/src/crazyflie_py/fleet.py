"""The vehicles of a fleet file, in Crazyswarm's layout or crazyswarm2's."""

import logging
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import rospkg

from crazyflie_fleet import fleet_file
from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_model.angles import Triple
from crazyflie_utils import ParameterError

#: Environment variables of the program that starts a script; they override the script's options.
#: If this one is set, the script flies ideal vehicles, as with --sim.
DRY_RUN = "CRAZYFLIE_PY_DRY_RUN"
#: Names of the script's vehicles, separated by colons.
VEHICLES = "CRAZYFLIE_PY_VEHICLES"

_LOG = logging.getLogger(__name__)

#: Where Crazyswarm and crazyswarm2 have the file, from the script's folder.
_PLACES = ("../launch/crazyflies.yaml", "../config/crazyflies.yaml")
_SUFFIXES = (".yaml", ".yml")  #: Endings of a text that is the name of a file.


class FleetVehicle(NamedTuple):
    """A vehicle."""

    name: str
    id: int  #: Last byte of the radio address, or else the number at the end of the name.
    position: Triple  #: Position before takeoff (m).
    buffer: float = 0.15  #: Radius of the space that is reserved for the vehicle (m).


def load(crazyflies_yaml: str | Path | None) -> list[FleetVehicle]:
    """Return the `chosen` vehicles of a file, or of a text in YAML.

    Without either they are those of the usual file, or else those of the examples.

    FileNotFoundError, ValueError: the message says what was expected.
    """
    if crazyflies_yaml is None:
        crazyflies_yaml = _usual_file()
    is_text = isinstance(crazyflies_yaml, str) and not crazyflies_yaml.endswith(_SUFFIXES)
    try:
        if is_text:
            config = fleet_file.parse(str(crazyflies_yaml), "crazyflies_yaml")
        else:
            config = fleet_file.load(crazyflies_yaml)
    except ParameterError as error:
        raise ValueError(str(error)) from None
    vehicles = [
        FleetVehicle(vehicle.name, _id(vehicle), vehicle.position, vehicle.buffer)
        for vehicle in config.vehicles
    ]
    ids = [vehicle.id for vehicle in vehicles]
    for vehicle_id in ids:
        if ids.count(vehicle_id) > 1:
            same = ", ".join(v.name for v in vehicles if v.id == vehicle_id)
            raise ValueError(f"{same} have the same id, {vehicle_id}; expected different ids")
    names = chosen([vehicle.name for vehicle in vehicles])
    return [vehicle for vehicle in vehicles if vehicle.name in names]


def chosen(names: Sequence[str]) -> list[str]:
    """Return the vehicles of a fleet that the environment variable `VEHICLES` names.

    Without it, return all. ValueError if it names none of them.
    """
    text = os.environ.get(VEHICLES)
    if not text:
        return list(names)
    wanted = text.split(":")
    if found := [name for name in names if name in wanted]:
        return found
    raise ValueError(f"{VEHICLES} is {text}; expected vehicles of {', '.join(names)}")


def _id(vehicle: VehicleConfig) -> int:
    if vehicle.id is not None:
        return vehicle.id
    # The end of the address, as in crazyswarm2; without an address, the number in the name.
    address = "" if vehicle.uri is None else vehicle.uri.split("?")[0]
    if found := re.search("[0-9A-Fa-f]{2}$", address):
        return int(found[0], 16)
    if found := re.search("[0-9]+$", vehicle.name):
        return int(found[0])
    raise ValueError(
        f"{vehicle.name} has no id: its address is {vehicle.uri}; expected "
        "radio://0/80/2M/E7E7E7E7E7 or another whose last two characters are the id, hexadecimal, "
        "or a name with a number at its end"
    )


def _usual_file():
    script = Path(sys.argv[0]).parent
    places = [folder / place for place in _PLACES for folder in (Path(), script)]
    for path in places:
        if path.is_file():
            return path
    path = Path(rospkg.RosPack().get_path("crazyflie_py")) / "launch" / "crazyflies.yaml"
    _LOG.warning(
        "no fleet file was found (%s); flying the vehicles of %s",
        ", ".join(map(str, dict.fromkeys(places))),
        path,
    )
    return path
