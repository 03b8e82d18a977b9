"""The process that flies the vehicles of a fleet."""

from collections.abc import Mapping
from typing import Any

from crazyflie_driver.positioning import MOCAP, SOURCES
from crazyflie_fleet.connect_node import BatteryReportNode
from crazyflie_fleet.fleet_config import BUFFER, FleetConfig, VehicleConfig
from crazyflie_fleet.fleet_parameters import FlyParameters
from crazyflie_fleet.fleet_services_node import FleetServicesNode
from crazyflie_fleet.high_level_node import HighLevelNode
from crazyflie_fleet.high_level_services import HIGH_LEVEL
from crazyflie_fleet.references_node import ReferencesNode
from crazyflie_fleet.vectorized_simulator_node import (
    ALL_STATES,
    MODELS,
    VectorizedSimulatorNode,
    VectorizedSimulatorParameters,
)
from crazyflie_fleet.vehicle_nodes import (
    INHIBITION,
    OBSTACLES,
    PLACE,
    WITHOUT_YAW,
    Tree,
    merged,
    node_classes,
    parameters,
)
from crazyflie_model.aerodynamics import Air
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_takeoff.all_emergency_node import AllEmergencyNode
from crazyflie_utils import Node, NodeHandle, ParameterError


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return all nodes of the process by name, and set the parameters that they will load.

    `ParameterError`: a parameter, or the fleet file, is wrong.
    """
    return _NodeFactory(handle, handle.load(FlyParameters)).nodes


#: Most vehicles with which a fence shares the room: each answers the states of all of them.
MAX_NEIGHBOURS = 20


class _NodeFactory:
    """Makes the nodes of the process."""

    def __init__(self, handle: NodeHandle, config: FlyParameters):
        self._handle = handle
        self._config = config
        self.nodes: dict[str, Node] = {}
        # One simulator is the source of simulated time.
        self._has_clock = False
        vectorized: dict[str, tuple[VehicleConfig, ...]] = {}
        fleet = config.fleet()
        self._places = {name: place for place, name in enumerate(fleet.names)}
        self._has_fence = config.fence or fleet.fence
        if self._has_fence and len(fleet.names) > MAX_NEIGHBOURS + 1:
            handle.warn(
                f"the fences of {len(fleet.names)} vehicles do not keep them apart, only in the "
                f"box: that is for up to {MAX_NEIGHBOURS + 1} vehicles; the avoidance of "
                "collisions changes their references, as without fences"
            )
        own_names = config.own_names(fleet)
        if not config.is_simulated:
            _check_positioning(config.file, fleet)
        obstacles = {
            each.name: {"frame": each.mocap_frame, "buffer": each.buffer}
            for each in fleet.obstacles
        }
        handle.set_param(OBSTACLES, obstacles)
        vehicles = tuple(fleet[name] for name in own_names)
        self._air = Air() if config.downwash else None
        if config.downwash and any(each.dynamics in MODELS for each in vehicles):
            handle.warn(
                "downwash has an effect on vehicles of the model quadrotor, or of a type, only"
            )
        for model in MODELS if config.is_simulated and config.is_vectorized else ():
            of_model = tuple(each for each in vehicles if each.dynamics == model)
            if of_model:
                vectorized[self._add_vectorized(model, of_model)] = of_model
        self._unplaced = {name for pair in fleet.unplaced for name in pair}
        for vehicle in vehicles:
            self._add_vehicle(vehicle)
        is_measured = not (config.is_simulated or config.virtual_port)
        references = ReferencesNode(
            fleet, own_names, config.fixed_frame, vectorized, has_motion_capture=is_measured
        )
        # This node comes first, since the others answer the same references of the takeoff servers.
        self.nodes[f"{handle.name}/references"] = references
        for vehicle, tracked in zip(vehicles, references.vehicles, strict=True):
            self._add_high_level(vehicle, tracked)
        if not config.is_simulated:
            self.nodes[f"{handle.name}/battery_report"] = BatteryReportNode(vehicles)
        if vehicles[0] is fleet.vehicles[0]:
            # One process serves all vehicles, also those of other machines.
            self.nodes[handle.name] = FleetServicesNode(fleet, references.states)
            self.nodes["/all_emergency"] = AllEmergencyNode()

    def _add(self, name: str, node: Node, tree: Mapping[str, Any]) -> None:
        self._handle.set_param(name, dict(tree))
        self.nodes[name] = node

    def _common(self, model: str) -> Tree:
        tree = merged(self._config.common, (self._config.by_model or {}).get(model, {}))
        if self._has_clock:
            tree = merged(tree, {"simulator": {"clock": {"publish": False}}})
        return tree

    def _add_vectorized(self, model: str, vehicles: tuple[VehicleConfig, ...]) -> str:
        """Add the simulator of all vehicles of a model; return the topic of their states."""
        name = f"{self._handle.name}/{model}"
        tree = self._common(model)
        own: Tree = {key: tree[key] for key in ("simulator", "lqr_controller") if key in tree}
        known = {each.name for each in VectorizedSimulatorParameters.declarations()}
        unknown = [path for path in _paths(own) if path not in known]
        if unknown:
            raise ParameterError(
                *(
                    f"parameter {self._handle.name}/nodes/{path} has no effect on vehicles that "
                    "are flown together; expected together:=false with it"
                    for path in unknown
                )
            )
        frames = {"fixed": self._config.fixed_frame}
        self._add(name, VectorizedSimulatorNode(vehicles, model), {**own, "frames": frames})
        self._has_clock = True
        return f"{name}/{ALL_STATES}"

    def _add_vehicle(self, vehicle: VehicleConfig) -> None:
        classes = node_classes(vehicle, self._config.is_simulated, self._has_fence)
        if f"{self._handle.name}/{vehicle.dynamics}" in self.nodes:
            for name in ("simulator", "state_estimator", "lqr_controller"):
                del classes[name]
        self._handle.set_param(f"/{vehicle.name}/{BUFFER}", vehicle.buffer)
        self._handle.set_param(f"/{vehicle.name}/{PLACE}", self._places[vehicle.name])
        frames = {"fixed": self._config.fixed_frame, "robot": vehicle.name}
        others = [name for name in self._places if name != vehicle.name]
        if len(others) > MAX_NEIGHBOURS:
            others = []
        tree = parameters(vehicle, frames, self._common(vehicle.dynamics), self._has_fence, others)
        if vehicle.name in self._unplaced:
            tree["takeoff_server"]["topics"]["inhibition"] = INHIBITION
        for name, node_class in (self._config.extra_nodes or {}).items():
            own = merged(tree.get(name, {}), {"frames": frames})
            self._add(f"/{vehicle.name}/{name}", node_class(), own)
        for name, node_class in classes.items():
            node = node_class()
            if isinstance(node, QuadrotorSimulatorNode):
                node.air = self._air
            self._add(f"/{vehicle.name}/{name}", node, tree[name])
        self._has_clock = True

    def _add_high_level(self, vehicle, tracked):
        name = f"/{vehicle.name}/{HIGH_LEVEL}"
        if name not in self.nodes:
            own = self._common(vehicle.dynamics).get(HIGH_LEVEL, {})
            frames = {"fixed": self._config.fixed_frame, "robot": vehicle.name}
            has_yaw = not self._config.is_simulated or vehicle.dynamics not in WITHOUT_YAW
            known: Tree = {"frames": frames, "reference": {"yaw": has_yaw}}
            self._add(name, HighLevelNode(tracked), merged(own, known))


def _check_positioning(file: str, fleet: FleetConfig) -> None:
    errors = [
        f"{file}: {each.name} has motion_capture/enabled: false; expected true, or positioning: "
        f"{', '.join(source for source in SOURCES if source != MOCAP)}"
        for each in (*fleet.vehicles, *fleet.obstacles)
        if each.positioning == MOCAP and not each.mocap_enabled
    ]
    if errors:
        raise ParameterError(*errors)


def _paths(tree: Mapping[str, Any], prefix: str = "") -> list[str]:
    paths = []
    for key, value in tree.items():
        is_branch = isinstance(value, Mapping)
        paths += _paths(value, f"{prefix}{key}/") if is_branch else [prefix + key]
    return paths
