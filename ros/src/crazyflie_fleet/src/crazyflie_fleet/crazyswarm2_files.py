"""crazyswarm2's motion_capture.yaml and server.yaml as parameters of the nodes here."""

from pathlib import Path
from typing import Any

from crazyflie_fleet.fleet_parser import Remarks
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.types import SHARE, TEXT, ListOf, Number, Text

_CONFIGURATIONS = ("marker_configurations", "dynamics_configurations")

#: Type of motion capture -> backend of mocap_node.
_BACKENDS = {
    "optitrack": "natnet",
    "optitrack_closed_source": "natnet",
    "vicon": "vicon",
    "qualisys": "qualisys",
    "vrpn": "vrpn",
}

_LINK = "warnings/communication/"
#: Settings without effect here, because the driver's diagnostics come once a second, with the
#: figures of each link; it reads all parameters; and a simulation has a launch file of its own.
_WITHOUT_EFFECT = ("warnings/frequency", _LINK + "publish_stats", "firmware_params", "sim")


class MotionCaptureSettings(Parameters):
    """Type and host of motion capture."""

    type: str = parameter(Text(tuple(_BACKENDS)), "type of the system")
    hostname: str = parameter(TEXT, "host name of the computer that runs it")


def node_parameters(path: str | Path) -> yaml_file.Entry:
    """Return the parameters of the first node in a file of ROS 2; raises `ParameterError`."""
    top = yaml_file.load(path)
    for node in top.entries().values():
        if "ros__parameters" in node:
            return node["ros__parameters"]
    raise top.error("has no ros__parameters of a node; expected crazyswarm2's layout")


def load_motion_capture(path: str | Path) -> dict[str, Any]:
    """Return backend, address, and configurations of markers and dynamics, as mocap_node has them.

    `ParameterError` names all errors: file, line, and what was expected.
    """
    node = node_parameters(path)
    # Here, their topics and rigid bodies follow from the fleet file.
    settings = node.read(MotionCaptureSettings, _CONFIGURATIONS, lambda entry, known: None)
    address, backend = "motioncapture_config/hostname", _BACKENDS[settings.type]
    if backend == "natnet":
        address = "optitrack_config/server_address"
    given = {key: node[key].value for key in _CONFIGURATIONS if key in node}
    return {"backend": backend, address: settings.hostname, **given}


class ServerSettings(Parameters):
    """Thresholds of the warnings of crazyswarm2's server, named as the driver's of a link."""

    rate_limits: tuple[float, float] | None = parameter(
        ListOf(Number("Hz", minimum=0.0), 2),
        "lowest and highest rate of motion capture frames",
        None,
        "warnings/motion_capture/warning_if_rate_outside",
    )
    max_latency: float | None = parameter(
        Number("ms", above=0.0), "of a link", None, _LINK + "max_unicast_latency"
    )
    min_quality: float | None = parameter(SHARE, "of packets", None, _LINK + "min_unicast_ack_rate")
    min_unicast_rate: float | None = parameter(
        SHARE, "received", None, _LINK + "min_unicast_receive_rate"
    )
    min_broadcast_rate: float | None = parameter(
        SHARE, "received", None, _LINK + "min_broadcast_receive_rate"
    )


def load_server(path: str | Path) -> tuple[dict[str, Any], dict[str, Any], tuple[str, ...]]:
    """Return the content of server.yaml: parameters of the driver and of mocap_node, and remarks.

    `ParameterError` names all errors: file, line, and what was expected.
    """
    node = node_parameters(path)
    remarks = Remarks()

    def on_unknown(entry, known):
        key = entry.name.removeprefix(f"{node.name}/")
        if key in _WITHOUT_EFFECT:
            remarks.idle(entry, key)
        else:
            remarks.unknown(entry, known)

    settings = vars(node.read(ServerSettings, on_unknown=on_unknown))
    given = {name: value for name, value in settings.items() if value is not None}
    motion_capture = {"rate_limits": [*given.pop("rate_limits")]} if "rate_limits" in given else {}
    if "max_latency" in given:
        given["max_latency"] /= 1000.0
    driver = {f"link/{name}": value for name, value in given.items()}
    return driver, motion_capture, remarks.texts()
