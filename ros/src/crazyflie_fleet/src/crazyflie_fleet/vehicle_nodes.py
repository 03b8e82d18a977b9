"""The nodes that fly one vehicle, and their parameters."""

from collections.abc import Mapping, Sequence
from typing import Any

from crazyflie_control_merger.cmd_vel_converter_node import CmdVelConverterNode
from crazyflie_control_merger.merger_nodes import RegularControlMergerNode
from crazyflie_fleet.fleet_config import VehicleConfig
from crazyflie_geofence.geofence_node import GeofenceNode
from crazyflie_lqr.lqr_nodes import PositionVelocityYawStateLiftLqrNode
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_simulator.quadrotor_simulator_node import QuadrotorSimulatorNode
from crazyflie_simulator.simulator_node import (
    NearHoverSimulatorCoupled7DNode,
    NearHoverSimulatorNode,
)
from crazyflie_state_estimator.estimator_node import PositionVelocityYawStateEstimatorNode
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils import Node

Tree = dict[str, Any]  #: Parameters in the structure of the parameter server.

REFERENCE, SAFE_REFERENCE = "ref", "ref_safe"
DESCENT, SAFE_DESCENT = f"{REFERENCE}_descent", f"{REFERENCE}_descent_safe"
STATE, LQR_CONTROL = "state", "control/lqr"
FENCE_CONTROL, MERGED_CONTROL = "control/geofence", "control/merged"
TAKEOFF_CONTROL, FINAL_CONTROL = "control/takeoff", "control/final"
IN_FLIGHT = "in_flight"
FLIGHT_STATUS = f"{IN_FLIGHT}_flight_status"  #: Topics and services of a vehicle, below its name.
#: Topic below a vehicle's name: the reason for refusing takeoffs; empty if they are allowed.
INHIBITION = "takeoff_inhibition"
#: Parameter: the obstacles of the fleet, by name their tf frame, and their buffer (m).
OBSTACLES = "/fleet/obstacles"
#: Parameter below a vehicle's name: its index in the fleet file, from 0.
PLACE = "place_in_fleet"

SIMULATORS: dict[str, type[Node]] = {
    "near_hover": NearHoverSimulatorNode,
    "coupled_7d": NearHoverSimulatorCoupled7DNode,
    "quadrotor": QuadrotorSimulatorNode,
}

#: Models whose vehicles cannot fly at a heading other than 0: their tilt does not turn with them.
WITHOUT_YAW = ("near_hover",)


class FleetLqrNode(PositionVelocityYawStateLiftLqrNode):
    """The same controller, to a position, velocity and yaw."""

    reference_type = PositionVelocityYawStateStamped
    reference_tail = ()


HOVER_NODES: dict[str, type[Node]] = {
    "state_estimator": PositionVelocityYawStateEstimatorNode,
    "lqr_controller": FleetLqrNode,
    "takeoff_server": TakeoffServerNode,
    "takeoff_control_filter": TakeoffControlFilterNode,
}


FENCE_NODES: dict[str, type[Node]] = {
    "geofence": GeofenceNode,
    "control_merger": RegularControlMergerNode,
}


def node_classes(
    vehicle: VehicleConfig, is_simulated: bool, has_fence: bool = False
) -> dict[str, type[Node]]:
    """Return the classes of a vehicle's nodes, by their names below the vehicle's."""
    nodes = {**HOVER_NODES, **(FENCE_NODES if has_fence else {})}
    if is_simulated:
        return {"simulator": SIMULATORS[vehicle.dynamics], **nodes}
    return {"cmd_vel_converter": CmdVelConverterNode, **nodes}


def parameters(
    vehicle: VehicleConfig,
    frames: Mapping[str, str],
    common: Mapping[str, Any],
    has_fence: bool = False,
    others: Sequence[str] = (),
) -> Tree:
    """Return the parameters of a vehicle's nodes, node by node.

    ``frames`` are the names of the tf frames, fixed and robot; ``common`` the parameters of all
    vehicles, node by node; ``others`` the names of those with which its fence shares the room.
    """
    hover, model = vehicle.hover_point, vehicle.vehicle_model
    own: Tree = {
        "simulator": {
            "frames": frames,
            "init": dict(zip("xyz", vehicle.position, strict=True)),
            "topics": {"control": FINAL_CONTROL},
            "model": model,
        },
        "cmd_vel_converter": {
            "topics": {"control": FINAL_CONTROL, "cmd_vel": "cmd_vel"},
            "model": model,
        },
        "state_estimator": {
            "x_dim": 7,
            "frames": frames,
            "topics": {"state": STATE, "control": FINAL_CONTROL},
        },
        "lqr_controller": {
            "x_dim": 7,
            "u_dim": 4,
            "topics": {
                "reference": SAFE_REFERENCE,
                "descent_reference": SAFE_DESCENT,
                "state": STATE,
                "control": LQR_CONTROL,
                "in_flight": IN_FLIGHT,
            },
        },
        "takeoff_server": {
            "hover": dict(zip("xyz", hover, strict=True)),
            "topics": {
                "reference": REFERENCE,
                "control": TAKEOFF_CONTROL,
                "in_flight": IN_FLIGHT,
                "state": STATE,
                "battery": "battery",
            },
            "srv": {"takeoff": "takeoff", "land": "land"},
            "battery": dict(zip(("low", "critical"), vehicle.battery_limits, strict=True)),
        },
        "takeoff_control_filter": {
            "topics": {
                "takeoff_control": TAKEOFF_CONTROL,
                "commanded_control": LQR_CONTROL,
                "final_control": FINAL_CONTROL,
                "in_flight": IN_FLIGHT,
                "state": STATE,
            },
            "srv": {"emergency": "emergency", "emergency_reset": "emergency_reset"},
            "model": model,
        },
    }
    if model != "cf21":
        own["lqr_controller"]["K_file"] = model
    if has_fence:
        own["geofence"] = {
            "topics": {
                "state": STATE,
                "control": LQR_CONTROL,
                "prioritized_control": FENCE_CONTROL,
                "final_control": FINAL_CONTROL,
                "others": [f"/{name}/{STATE}" for name in others],
            },
            "model": model,
            "buffer": vehicle.buffer,
        }
        own["control_merger"] = {
            "topics": {
                "control": LQR_CONTROL,
                "prioritized_control": FENCE_CONTROL,
                "merged": MERGED_CONTROL,
            },
            "mode": "MERGE",
        }
        own["takeoff_control_filter"]["topics"]["commanded_control"] = MERGED_CONTROL
        for name in ("takeoff_server", "takeoff_control_filter"):
            own[name]["topics"]["box"] = "geofence/parameter_updates"
    return merged(common, own)


def merged(first: Mapping[str, Any], second: Mapping[str, Any]) -> Tree:
    """Return both trees in one; where both have a value, it is that of the second."""
    tree = dict(first)
    for key, value in second.items():
        is_branch = isinstance(value, Mapping) and isinstance(tree.get(key), Mapping)
        tree[key] = merged(tree[key], value) if is_branch else value
    return tree
