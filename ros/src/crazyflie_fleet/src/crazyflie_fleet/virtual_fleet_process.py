"""A process with virtual vehicles and a motion capture system that measures them."""

from dataclasses import replace

from crazyflie_fleet.fleet_parameters import FleetParameters
from crazyflie_fleet.mocap_process import bodies
from crazyflie_model.aerodynamics import Air
from crazyflie_utils import Node, NodeHandle, ParameterError, parameter
from crazyflie_utils.parameters.types import BOOLEAN, PORT, Number
from crazyflie_virtual.nodes import VirtualCrazyflieNode, VirtualMocapNode
from crazyflie_virtual.settings import DECK, FLOW, LIGHTHOUSE, LOCO, OBSERVER_PORT
from mocap_optitrack.mocap_node import MocapNode

_FRACTION = Number(minimum=-0.5, maximum=0.5)


class VirtualFleetParameters(FleetParameters):
    """Parameters of the process."""

    observer_port: int = parameter(PORT, "UDP port of the vehicles' true poses", OBSERVER_PORT)
    command_port: int = parameter(PORT, "UDP port of motion capture", 1510)
    data_port: int = parameter(PORT, "UDP port of its stream", 1511)
    mass_error: float = parameter(_FRACTION, "how much heavier than nominal the vehicles are", 0.05)
    thrust_error: float = parameter(
        _FRACTION, "how much more than nominal their rotors lift", -0.05
    )
    downwash: bool = parameter(
        BOOLEAN, "whether vehicles below others feel the air that those move", False
    )
    ground_effect: bool = parameter(BOOLEAN, "whether rotors lift more near the ground", False)
    position_noise: float = parameter(Number("m", minimum=0.0), "of motion capture", 0.0002)
    attitude_noise: float = parameter(Number("rad", minimum=0.0), "of motion capture", 0.001)


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return all nodes of the process by name, and set the parameters that they will load.

    `ParameterError`: a parameter, or the fleet file, is wrong.
    """
    config = handle.load(VirtualFleetParameters)
    if not config.virtual_port:
        raise ParameterError(f"parameter {handle.name}/fleet/virtual_port is 0; expected a port")
    nodes: dict[str, Node] = {}
    fleet = config.fleet()
    air = Air() if config.downwash else None
    for number, vehicle in enumerate(fleet.vehicles):
        x, y, z = vehicle.position
        if z != 0.0:
            handle.warn(f"{vehicle.name} starts on the ground, and not at a height of {z:g} m")
        name = f"{handle.name}/{vehicle.name}"
        observer = {"port": config.observer_port, "name": vehicle.name, "id": number + 1}
        has_deck = vehicle.positioning in (FLOW, LIGHTHOUSE, LOCO)
        parameters = {
            "port": config.virtual_port + number,
            "init": {"x": x, "y": y},
            "model": vehicle.vehicle_model,
            "mass_error": config.mass_error,
            "thrust_error": config.thrust_error,
            "ground_effect": config.ground_effect,
            "seed": number,
            "topics": {"true_pose": f"/{vehicle.name}/true_pose"},
            "positioning": vehicle.positioning if has_deck else DECK,
            "observer": observer,
        }
        handle.set_param(name, parameters)
        nodes[name] = node = VirtualCrazyflieNode()
        node.air = air
    # Nothing measures obstacles: the fleet's process has them at their initial positions.
    if not (seen := bodies(replace(fleet, obstacles=()), config.fixed_frame)):
        # All vehicles use their decks for positioning.
        return nodes
    ports = {"command_port": config.command_port, "data_port": config.data_port}
    single = [str(k) for k, vehicle in enumerate(fleet.vehicles, 1) if vehicle.has_single_marker]
    mocap = {
        **ports,
        "observer": {"port": config.observer_port},
        "noise": {"position": config.position_noise, "attitude": config.attitude_noise},
        "single_markers": ",".join(single),
    }
    local = {"server_address": "127.0.0.1", "local_address": "127.0.0.1"}
    client = {"backend": "natnet", "up_axis": "z", **seen, "optitrack_config": {**ports, **local}}
    handle.set_param(f"{handle.name}/mocap", mocap)
    handle.set_param("/mocap_node", client)
    return {**nodes, f"{handle.name}/mocap": VirtualMocapNode(), "/mocap_node": MocapNode()}
