"""The process that flies the vehicles of a fleet."""

from crazyflie_fleet.fleet_node import FleetNode
from crazyflie_fleet.fleet_parameters import FlyParameters
from crazyflie_fleet.references_node import ReferencesNode
from crazyflie_fleet.stack import merged, node_classes, parameters
from crazyflie_takeoff.all_emergency_node import AllEmergencyNode
from crazyflie_utils import Node, NodeHandle


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return all nodes of the process by name, and set the parameters that they will load.

    Raises
    ------
    ParameterError
        A parameter, or the fleet file, is wrong.
    """
    told = handle.load(FlyParameters)
    fleet = told.fleet()
    own = told.own_names(fleet)
    vehicles = tuple(fleet[name] for name in own)
    nodes: dict[str, Node] = {}
    for number, vehicle in enumerate(vehicles):
        by_model = (told.by_model or {}).get(vehicle.settings.model, {})
        common = merged(told.common, by_model)
        tree = parameters(vehicle, told.fixed_frame, common)
        if number > 0:
            # Of several simulators one is the source of simulated time.
            tree = merged(tree, {"simulator": {"clock": {"publish": False}}})
        for name, node_class in node_classes(vehicle, told.is_simulated).items():
            full_name = f"/{vehicle.name}/{name}"
            handle.set_param(full_name, tree[name])
            nodes[full_name] = node_class()
    nodes[f"{handle.name}/references"] = ReferencesNode(vehicles, told.fixed_frame)
    if vehicles[0] is fleet.vehicles[0]:
        # One process serves them all, also those of other machines.
        nodes[handle.name] = FleetNode(fleet)
        nodes["/all_emergency"] = AllEmergencyNode()
    return nodes
