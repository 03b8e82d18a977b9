"""crazyswarm2's server.yaml as parameters of the driver and of mocap_node."""

from pathlib import Path
from typing import Any, NamedTuple

from crazyflie_fleet.motion_capture_file import node_parameters
from crazyflie_fleet.remarks import Remarks
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import ListOf, Number

_LINK = "warnings/communication/"
_SHARE = Number("", minimum=0.0, maximum=1.0)
#: The driver's diagnostics come once a second, and have the figures of each link; it reads all
#: parameters; a simulation here is another launch file.
_WITHOUT_EFFECT = (
    "warnings/frequency",
    _LINK + "publish_stats",
    "firmware_params",
    "sim",
)


class ServerSettings(Parameters):
    """When crazyswarm2's server warns."""

    rate_limits: tuple[float, float] | None = parameter(
        ListOf(Number("Hz", minimum=0.0), 2),
        "frames of motion capture per second, at least and at most",
        None,
        "warnings/motion_capture/warning_if_rate_outside",
    )
    max_latency: float | None = parameter(
        Number("ms", above=0.0), "of a link", None, _LINK + "max_unicast_latency"
    )
    min_ack_rate: float | None = parameter(
        _SHARE, "of packets", None, _LINK + "min_unicast_ack_rate"
    )
    min_unicast_rate: float | None = parameter(
        _SHARE, "received", None, _LINK + "min_unicast_receive_rate"
    )
    min_broadcast_rate: float | None = parameter(
        _SHARE, "received", None, _LINK + "min_broadcast_receive_rate"
    )


class ServerFile(NamedTuple):
    """What the file says: parameters of the driver and of mocap_node, and remarks."""

    driver: dict[str, Any]
    motion_capture: dict[str, Any]
    remarks: tuple[str, ...]


def load(path: str | Path) -> ServerFile:
    """Return what a file says.

    Raises
    ------
    ParameterError
        About everything that is wrong: file, line, and what was expected.
    """
    node = node_parameters(path)
    remarks = Remarks()

    def on_unknown(entry, known):
        key = entry.name.removeprefix(f"{node.name}/")
        if key in _WITHOUT_EFFECT:
            remarks.idle(entry, key)
        else:
            remarks.unknown(entry, known)

    settings = node.read(ServerSettings, on_unknown=on_unknown)
    latency = settings.max_latency
    driver = {
        "link/max_latency": None if latency is None else latency / 1000.0,
        "link/min_quality": settings.min_ack_rate,
        "link/min_unicast_rate": settings.min_unicast_rate,
        "link/min_broadcast_rate": settings.min_broadcast_rate,
    }
    limits = settings.rate_limits
    return ServerFile(
        {key: value for key, value in driver.items() if value is not None},
        {} if limits is None else {"rate_limits": list(limits)},
        remarks.texts(),
    )
