"""The driver of a fleet, with the radio's settings in crazyswarm2's files."""

from crazyflie_driver.server_node import CrazyflieServerNode
from crazyflie_fleet.crazyswarm2_files import load_server
from crazyflie_fleet.fleet_parameters import FleetParameters
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import Text


class DriverFleetParameters(FleetParameters):
    """The fleet's vehicles, and thresholds of the driver's warnings."""

    server: str = parameter(
        Text(may_be_empty=True),
        "crazyswarm2's server.yaml; its limits of communication replace the driver's",
        "",
        "fleet/server",
    )


def make_nodes(handle: NodeHandle) -> dict[str, Node]:
    """Return the driver, and set the parameters that the files contain.

    `ParameterError`: a parameter, or a file, is wrong.
    """
    config = handle.load(DriverFleetParameters)
    given = config.fleet().broadcasts
    if config.server:
        limits, _, remarks = load_server(config.server)
        given = {**given, **limits}
        for remark in remarks:
            handle.warn(remark)
    for key, value in given.items():
        handle.set_param(f"{handle.name}/{key}", value)
    return {handle.name: CrazyflieServerNode()}
