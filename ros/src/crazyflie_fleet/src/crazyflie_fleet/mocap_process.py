"""Motion capture of a fleet: rigid bodies by their names, and vehicles with one marker."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from crazyflie_driver.positioning import MOCAP
from crazyflie_fleet.crazyswarm2_files import load_motion_capture, load_server
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.fleet_parameters import NODE_PARAMETERS, FleetParameters
from crazyflie_utils import Node, NodeHandle, ParameterError, parameter
from crazyflie_utils.parameters.types import Text
from mocap_optitrack.mocap_node import MocapNode

#: Name to configuration, as in crazyswarm2's motion_capture.yaml.
Configurations = Mapping[str, Mapping[str, Any]]


class MocapFleetParameters(FleetParameters):
    """The fleet's vehicles, and motion capture."""

    motion_capture: str = parameter(
        Text(may_be_empty=True),
        "crazyswarm2's motion_capture.yaml; its type, hostname, and configurations of markers and "
        "dynamics replace those of mocap_node",
        "",
        "fleet/motion_capture",
    )
    server: str = parameter(
        Text(may_be_empty=True),
        "crazyswarm2's server.yaml; its limits of the rate replace mocap_node's `rate_limits`",
        "",
        "fleet/server",
    )


def bodies(
    fleet: FleetConfig,
    fixed_frame: str,
    dynamics: Configurations = MappingProxyType({}),
    markers: Configurations = MappingProxyType({}),
) -> dict[str, Any]:
    """Return the parameters of mocap_node for its bodies and markers.

    A vehicle with one marker gets its position, for its own estimator, by the driver's topic
    external_position, and its yaw on tf is that estimator's. ``dynamics`` and ``markers`` are
    mocap_node's ``dynamics_configurations`` and ``marker_configurations``.
    """
    result: dict[str, Any] = {}
    for vehicle in (*fleet.vehicles, *fleet.obstacles):
        if vehicle.positioning != MOCAP:
            continue
        frames = {"parent_frame_id": fixed_frame, "child_frame_id": vehicle.mocap_frame}
        if vehicle.has_single_marker:
            result.setdefault("single_markers", {})[vehicle.name] = {
                **frames,
                "initial_position": list(vehicle.position),
                "position": f"/{vehicle.name}/external_position",
                "heading": f"/{vehicle.name}/heading",
                **_limits(dynamics.get(vehicle.mocap_dynamics, {})),
                **_offset(markers.get(vehicle.mocap_marker, {})),
            }
        else:
            result.setdefault("rigid_bodies", {})[vehicle.name] = frames
    return result


def _limits(configuration):
    names = ("max_velocity", "max_acceleration")
    return {name: configuration[name] for name in names if name in configuration}


def _offset(configuration):
    points = list(configuration.get("points", {}).values())
    if len(points) != 1:
        return {}
    # Both offsets are added to the marker's position, as in librigidbodytracker.
    offset = configuration.get("offset", [0.0, 0.0, 0.0])
    return {"offset": [a + b for a, b in zip(points[0], offset, strict=True)]}


def _check_names(fleet, key, setting, configurations):
    """Raise `ParameterError` about vehicles whose configuration is missing."""
    known = [*configurations, "default"]
    errors = [
        f"robots/{vehicle.name}/motion_capture/{key} is {name!r}; expected one of "
        f"{', '.join(dict.fromkeys(known))}: {key}_configurations of mocap_node"
        for vehicle in fleet.vehicles
        if vehicle.has_single_marker
        for name in [getattr(vehicle, setting)]
        if configurations and name not in known
    ]
    if errors:
        raise ParameterError(*errors)


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return mocap_node, which publishes the bodies of the fleet file and those configured.

    `ParameterError`: a parameter, or the fleet file, is wrong.
    """
    config = handle.load(MocapFleetParameters)
    given = load_motion_capture(config.motion_capture) if config.motion_capture else {}
    if config.server:
        _, limits, _ = load_server(config.server)
        given |= limits
    for key, value in given.items():
        handle.set_param(f"{handle.name}/{key}", value)
    fleet, kind = config.fleet(), NODE_PARAMETERS
    dynamics = handle.get_param("~dynamics_configurations", kind, {})
    markers = handle.get_param("~marker_configurations", kind, {})
    _check_names(fleet, "dynamics", "mocap_dynamics", dynamics)
    _check_names(fleet, "marker", "mocap_marker", markers)
    for key, entries in bodies(fleet, config.fixed_frame, dynamics, markers).items():
        configured = handle.get_param(f"~{key}", kind, {})
        frames = [entry.get("child_frame_id") for entry in configured.values()]
        own = {name: e for name, e in entries.items() if e["child_frame_id"] not in frames}
        handle.set_param(f"{handle.name}/{key}", {**own, **configured})
    return {handle.name: MocapNode()}
