"""Motion capture of a fleet: rigid bodies by their names, and vehicles with one marker."""

from typing import Any

from crazyflie_fleet import motion_capture_file
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.fleet_parameters import FleetParameters, NodeParameters
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import Text
from mocap_optitrack.mocap_node import MocapNode


class MocapFleetParameters(FleetParameters):
    """Which vehicles there are, and where motion capture is."""

    motion_capture: str = parameter(
        Text(may_be_empty=True),
        "crazyswarm2's motion_capture.yaml; its type, hostname, and configurations of markers and "
        "dynamics replace those of mocap_node",
        "",
        "fleet/motion_capture",
    )


def bodies(fleet: FleetConfig, fixed_frame: str) -> dict[str, Any]:
    """Return the parameters of mocap_node that say what it publishes.

    A vehicle with one marker gets its position, for its own estimator, by the driver's topic
    external_position, and its yaw on tf is that estimator's.
    """
    result: dict[str, Any] = {}
    for vehicle in fleet.vehicles:
        frames = {"parent_frame_id": fixed_frame, "child_frame_id": vehicle.mocap_frame}
        if vehicle.settings.has_single_marker:
            result.setdefault("single_markers", {})[vehicle.name] = {
                **frames,
                "initial_position": list(vehicle.position),
                "position": f"/{vehicle.name}/external_position",
                "heading": f"/{vehicle.name}/heading",
            }
        else:
            result.setdefault("rigid_bodies", {})[vehicle.name] = frames
    return result


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return mocap_node; what it publishes is what the fleet file says, and what is configured.

    Raises
    ------
    ParameterError
        A parameter, or the fleet file, is wrong.
    """
    config = handle.load(MocapFleetParameters)
    if config.motion_capture:
        for key, value in motion_capture_file.load(config.motion_capture).items():
            handle.set_param(f"{handle.name}/{key}", value)
    for key, entries in bodies(config.fleet(), config.fixed_frame).items():
        configured = handle.get_param(f"~{key}", NodeParameters(), {})
        frames = [entry.get("child_frame_id") for entry in configured.values()]
        own = {name: e for name, e in entries.items() if e["child_frame_id"] not in frames}
        handle.set_param(f"{handle.name}/{key}", {**own, **configured})
    return {handle.name: MocapNode()}
