"""Node handle, nodes and declared parameters: the base of every node of the workspace.

The names below are loaded when they are first used, so that algorithms can
import `crazyflie_utils.parameters.declaration` and the like without ROS.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from crazyflie_utils.handle import NodeHandle as NodeHandle
    from crazyflie_utils.main import run as run
    from crazyflie_utils.main import run_nodes as run_nodes
    from crazyflie_utils.node import Node as Node
    from crazyflie_utils.parameters.declaration import ParameterError as ParameterError
    from crazyflie_utils.parameters.declaration import Parameters as Parameters
    from crazyflie_utils.parameters.declaration import parameter as parameter
    from crazyflie_utils.parameters.declaration import topic as topic
    from crazyflie_utils.program import run_program as run_program
    from crazyflie_utils.refusal import ServiceError as ServiceError
    from crazyflie_utils.tf.frame_tree import StampedPose as StampedPose
    from crazyflie_utils.tf.frame_tree import TransformError as TransformError

_HOME = {
    "Node": "crazyflie_utils.node",
    "NodeHandle": "crazyflie_utils.handle",
    "ParameterError": "crazyflie_utils.parameters.declaration",
    "Parameters": "crazyflie_utils.parameters.declaration",
    "ServiceError": "crazyflie_utils.refusal",
    "StampedPose": "crazyflie_utils.tf.frame_tree",
    "TransformError": "crazyflie_utils.tf.frame_tree",
    "parameter": "crazyflie_utils.parameters.declaration",
    "run": "crazyflie_utils.main",
    "run_nodes": "crazyflie_utils.main",
    "run_program": "crazyflie_utils.program",
    "topic": "crazyflie_utils.parameters.declaration",
}


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
