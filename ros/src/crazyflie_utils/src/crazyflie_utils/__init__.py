"""What every node of the workspace needs: the node handle and parameters.

The names below are loaded when they are first used, so that algorithms can
import `crazyflie_utils.held` and the like without ROS.
"""

import importlib

_HOME = {
    "Node": "crazyflie_utils.node",
    "NodeHandle": "crazyflie_utils.node_handle",
    "ParameterError": "crazyflie_utils.parameters",
    "ServiceError": "crazyflie_utils.transport",
    "run": "crazyflie_utils.runner",
    "run_composed": "crazyflie_utils.runner",
}

__all__ = ["Node", "NodeHandle", "ParameterError", "ServiceError", "run", "run_composed"]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOME[name]), name)
