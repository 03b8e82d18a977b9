"""The file that names the vehicles of a fleet, laid out as one of Crazyswarm 1 or crazyswarm2."""

import math
from pathlib import Path

from crazyflie_fleet import crazyswarm1
from crazyflie_fleet.fleet_config import FleetConfig, VehicleConfig
from crazyflie_fleet.fleet_parser import FleetParser, close_vehicles
from crazyflie_fleet.settings import RobotSettings
from crazyflie_utils import ParameterError
from crazyflie_utils.parameters import yaml_file

FIRST_PORT = 19850  #: UDP port of a grid's first vehicle.
TYPES_FILE = "crazyflieTypes.yaml"  #: Name of Crazyswarm 1's second file, beside the first.


def load(path: str | Path) -> FleetConfig:
    """Return the fleet that a file describes.

    A file in Crazyswarm 1's layout has its types in `TYPES_FILE` beside it.

    Raises
    ------
    ParameterError
        About everything that is wrong: file, line, and what was expected.
    """
    types = Path(path).with_name(TYPES_FILE)
    return _fleet(yaml_file.load(path), types if types.exists() else None)


def parse(text: str, name: str = "crazyflies.yaml") -> FleetConfig:
    """Return the fleet that a YAML text describes, in either layout; ``name`` is for errors.

    Raises
    ------
    ParameterError
        As `load`.
    """
    return _fleet(yaml_file.parse(text, name), None)


def _fleet(top, types):
    if crazyswarm1.VEHICLES not in top:
        return FleetParser(top).fleet()
    parts = None if types is None else yaml_file.load(types)
    parser = FleetParser(crazyswarm1.converted(top, parts))
    if types is None and any("type" in each for each in top[crazyswarm1.VEHICLES].elements()):
        parser.remarks.add(f"{top.file}: there is no {TYPES_FILE} beside it; types have no effect")
    return parser.fleet()


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
    for _, _, distance, limit in close_vehicles(vehicles):
        raise ParameterError(
            f"the spacing of the grid is {distance:g} m; expected at least {limit:g} m, the "
            "collision buffers of two vehicles"
        )
    return FleetConfig(tuple(vehicles))
