"""A launch file for a fleet on several computers."""

import sys
from pathlib import Path
from xml.etree import ElementTree

from crazyflie_fleet import fleet_file
from crazyflie_fleet.fleet_config import LOCAL
from crazyflie_utils import ParameterError
from crazyflie_utils.text_file import user_path


def launch_text(path: str | Path) -> str:
    """Return a launch file by which each machine of a fleet file simulates its vehicles.

    The file has the same ``path`` on all these computers. `ParameterError` names all errors of
    the file.
    """
    path = user_path(path).absolute()
    fleet = fleet_file.load(path)
    used = dict.fromkeys(vehicle.machine for vehicle in fleet.vehicles)
    launch = ElementTree.Element("launch")
    for name in used:
        if name != LOCAL:
            machine = fleet.machines[name]
            attributes = {"name": name, "address": machine.address}
            attributes["env-loader"] = machine.env_loader
            if machine.user:
                attributes["user"] = machine.user
            ElementTree.SubElement(launch, "machine", attributes)
    for name in used:
        is_local = name == LOCAL
        arguments = {
            "fleet": str(path),
            "machine": name,
            "name": "fleet" if is_local else f"fleet_{name}",
            "host": "" if is_local else name,
            "rviz": "false",
        }
        file = "$(find crazyflie_examples)/launch/sw_swarm.launch"
        include = ElementTree.SubElement(launch, "include", file=file)
        for key, value in arguments.items():
            ElementTree.SubElement(include, "arg", name=key, value=value)
    ElementTree.indent(launch)
    return ElementTree.tostring(launch, "unicode") + "\n"


def main() -> int:
    """Print the launch file of the fleet file that the command line names."""
    if len(sys.argv) != 2:
        print("usage: rosrun crazyflie_fleet fleet_launch FILE > MY.launch", file=sys.stderr)
        return 1
    try:
        print(launch_text(sys.argv[1]), end="")
    except ParameterError as error:
        print(error, file=sys.stderr)
        return 1
    return 0
