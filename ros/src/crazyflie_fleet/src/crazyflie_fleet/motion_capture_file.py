"""crazyswarm2's motion_capture.yaml as parameters of mocap_node."""

from pathlib import Path
from typing import Any

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.types import TEXT, Text

_CONFIGURATIONS = ("marker_configurations", "dynamics_configurations")

#: Their type -> backend of mocap_node.
_BACKENDS = {
    "optitrack": "natnet",
    "optitrack_closed_source": "natnet",
    "vicon": "vicon",
    "qualisys": "qualisys",
    "vrpn": "vrpn",
}


class MotionCaptureSettings(Parameters):
    """Where motion capture is."""

    type: str = parameter(Text(tuple(_BACKENDS)), "of the system")
    hostname: str = parameter(TEXT, "of the computer that runs it")


def node_parameters(path: str | Path) -> yaml_file.Entry:
    """Return the parameters of the first node in a file of ROS 2; raises `ParameterError`."""
    top = yaml_file.load(path)
    for node in top.entries().values():
        if "ros__parameters" in node:
            return node["ros__parameters"]
    raise top.error("has no ros__parameters of a node; expected crazyswarm2's layout")


def load(path: str | Path) -> dict[str, Any]:
    """Return backend, address, and configurations of markers and dynamics, as mocap_node has them.

    Raises
    ------
    ParameterError
        About everything that is wrong: file, line, and what was expected.
    """
    node = node_parameters(path)
    # Topics and rigid bodies of theirs follow from the fleet file here.
    settings = node.read(MotionCaptureSettings, _CONFIGURATIONS, lambda entry, known: None)
    backend = _BACKENDS[settings.type]
    is_natnet = backend == "natnet"
    address = "optitrack_config/server_address" if is_natnet else "motioncapture_config/hostname"
    given = {key: node[key].value for key in _CONFIGURATIONS if key in node}
    return {"backend": backend, address: settings.hostname, **given}
