"""The process that flies the vehicles of a fleet."""

from collections.abc import Mapping
from typing import Any

from crazyflie_fleet.fleet import Fleet, Vehicle
from crazyflie_fleet.fleet_node import FleetNode
from crazyflie_fleet.fleet_parameters import FlyParameters
from crazyflie_fleet.references_node import ReferencesNode
from crazyflie_fleet.sightings import Sightings
from crazyflie_fleet.stack import BUFFER, Tree, merged, node_classes, parameters
from crazyflie_fleet.swarm_node import ALL_STATES, MODELS, SwarmNode, SwarmParameters
from crazyflie_takeoff.all_emergency_node import AllEmergencyNode
from crazyflie_utils import Node, NodeHandle, ParameterError


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return all nodes of the process by name, and set the parameters that they will load.

    Raises
    ------
    ParameterError
        A parameter, or the fleet file, is wrong.
    """
    return _Plan(handle, handle.load(FlyParameters)).nodes


class _Plan:
    """Which nodes there are."""

    def __init__(self, handle: NodeHandle, told: FlyParameters):
        self._handle = handle
        self._told = told
        self.nodes: dict[str, Node] = {}
        # Of all simulators one is the source of simulated time.
        self._has_clock = False
        swarms: dict[str, tuple[Vehicle, ...]] = {}
        fleet = told.fleet()
        vehicles = tuple(fleet[name] for name in told.own_names(fleet))
        others = tuple(each for each in fleet.vehicles if each not in vehicles)
        for model in MODELS if told.is_simulated and told.flies_together else ():
            of_model = tuple(each for each in vehicles if each.settings.model == model)
            if of_model:
                swarms[self._add_swarm(model, of_model)] = of_model
        for vehicle in vehicles:
            self._add_vehicle(vehicle)
        references = ReferencesNode(vehicles, others, told.fixed_frame, swarms)
        self.nodes[f"{handle.name}/references"] = references
        if vehicles[0] is fleet.vehicles[0]:
            self._add_services(fleet, references.sightings)

    def _add(self, name: str, node: Node, tree: Mapping[str, Any]) -> None:
        self._handle.set_param(name, dict(tree))
        self.nodes[name] = node

    def _common(self, model: str) -> Tree:
        tree = merged(self._told.common, (self._told.by_model or {}).get(model, {}))
        if self._has_clock:
            tree = merged(tree, {"simulator": {"clock": {"publish": False}}})
        return tree

    def _add_swarm(self, model: str, vehicles: tuple[Vehicle, ...]) -> str:
        """Return the topic of their states."""
        name = f"{self._handle.name}/{model}"
        tree = self._common(model)
        own: Tree = {key: tree[key] for key in ("simulator", "lqr_controller") if key in tree}
        known = {declaration.name for declaration in SwarmParameters.declarations()}
        unknown = [path for path in _paths(own) if path not in known]
        if unknown:
            raise ParameterError(
                *(
                    f"parameter {self._handle.name}/nodes/{path} has no effect on vehicles that "
                    "are flown together; expected together:=false with it"
                    for path in unknown
                )
            )
        self._add(
            name, SwarmNode(vehicles, model), {**own, "frames": {"fixed": self._told.fixed_frame}}
        )
        self._has_clock = True
        return f"{name}/{ALL_STATES}"

    def _add_vehicle(self, vehicle: Vehicle) -> None:
        classes = node_classes(vehicle, self._told.is_simulated)
        if f"{self._handle.name}/{vehicle.settings.model}" in self.nodes:
            for name in ("simulator", "state_estimator", "lqr_controller"):
                del classes[name]
        self._handle.set_param(f"/{vehicle.name}/{BUFFER}", vehicle.buffer)
        frames = {"fixed": self._told.fixed_frame, "robot": vehicle.name}
        tree = parameters(vehicle, frames, self._common(vehicle.settings.model))
        for name, node_class in (self._told.further or {}).items():
            own = merged(tree.get(name, {}), {"frames": frames})
            self._add(f"/{vehicle.name}/{name}", node_class(), own)
        for name, node_class in classes.items():
            self._add(f"/{vehicle.name}/{name}", node_class(), tree[name])
        self._has_clock = True

    def _add_services(self, fleet: Fleet, sightings: Sightings) -> None:
        # One process serves them all, also those of other machines.
        self.nodes[self._handle.name] = FleetNode(fleet, sightings)
        self.nodes["/all_emergency"] = AllEmergencyNode()


def _paths(tree: Mapping[str, Any], prefix: str = "") -> list[str]:
    paths = []
    for key, value in tree.items():
        is_branch = isinstance(value, Mapping)
        paths += _paths(value, f"{prefix}{key}/") if is_branch else [prefix + key]
    return paths
