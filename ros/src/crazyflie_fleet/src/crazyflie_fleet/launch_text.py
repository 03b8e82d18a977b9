"""A launch file for a fleet on several computers."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

from crazyflie_fleet import fleet_file
from crazyflie_fleet.settings import LOCAL


def launch_text(path: str | Path) -> str:
    """Return a launch file that has each machine of a fleet file simulate its vehicles.

    The file has the same ``path`` on all these computers.

    Raises
    ------
    ParameterError
        About everything that is wrong with the file.
    """
    path = Path(path).absolute()
    fleet = fleet_file.load(path)
    used = dict.fromkeys(vehicle.settings.machine for vehicle in fleet.vehicles)
    lines = ["<launch>"]
    for name in used:
        if name == LOCAL:
            continue
        machine = fleet.machines[name]
        attributes = {
            "name": name,
            "address": machine.address,
            "env-loader": machine.env_loader,
            **({"user": machine.user} if machine.user else {}),
        }
        words = " ".join(f"{key}={quoteattr(value)}" for key, value in attributes.items())
        lines.append(f"  <machine {words} />")
    for name in used:
        is_local = name == LOCAL
        arguments = {
            "fleet": str(path),
            "machine": name,
            "name": "fleet" if is_local else f"fleet_{name}",
            "host": "" if is_local else name,
            "rviz": "false",
        }
        lines.append('  <include file="$(find crazyflie_examples)/launch/sw_swarm.launch">')
        lines += [
            f"    <arg name={quoteattr(key)} value={quoteattr(value)} />"
            for key, value in arguments.items()
        ]
        lines.append("  </include>")
    return "\n".join([*lines, "</launch>", ""])
