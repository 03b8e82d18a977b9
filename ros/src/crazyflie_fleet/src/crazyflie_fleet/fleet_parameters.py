"""Parameters of the vehicles of a fleet, and of the process that flies them."""

from collections.abc import Mapping
from typing import Any

from crazyflie_driver.positioning import SOURCES
from crazyflie_fleet import fleet_file
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_utils import Node, ParameterError, Parameters, parameter
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FRAME,
    TEXT,
    Converted,
    Integer,
    Number,
    Text,
)


def _node_parameters(value):
    if not isinstance(value, dict) or not all(isinstance(each, dict) for each in value.values()):
        raise ValueError
    return value


#: Parameters of other nodes, which check them themselves.
NODE_PARAMETERS = Converted(_node_parameters, "a dictionary of dictionaries", "dictionary")


class FleetParameters(Parameters):
    """Parameters of the vehicles of a fleet."""

    file: str = parameter(
        Text(may_be_empty=True),
        "fleet file, which names the vehicles; empty for a grid of `n`",
        "",
        "fleet/file",
    )
    n: int = parameter(Integer(1, 1000), "number of vehicles of the grid", 5, "fleet/n")
    spacing: float = parameter(
        Number("m", above=0.0), "distance between neighbours in the grid", 1.0, "fleet/spacing"
    )
    machine: str = parameter(
        TEXT, "machine whose vehicles are flown here; `*` for all", "*", "fleet/machine"
    )
    virtual_port: int = parameter(
        Integer(0, 65535),
        "the vehicles are virtual: the k-th listens at this UDP port + k, whatever its address; 0 "
        "for real ones",
        0,
        "fleet/virtual_port",
    )
    fixed_frame: str = parameter(FRAME, "tf frame of the world", "world", "frames/fixed")
    positioning: str = parameter(
        Text(("", *SOURCES), may_be_empty=True),
        "source of the poses of all vehicles; empty for that of the file",
        "",
        "fleet/positioning",
    )

    def fleet(self) -> FleetConfig:
        """Return all vehicles, those of other machines included.

        `ParameterError` names all errors of the file.
        """
        fleet = fleet_file.load(self.file) if self.file else fleet_file.grid(self.n, self.spacing)
        if self.positioning:
            fleet = fleet.positioned_by(self.positioning)
        for vehicle in (*fleet.vehicles, *fleet.obstacles):
            for what, frame in (("name", vehicle.name), ("frame", vehicle.mocap_frame)):
                if frame == self.fixed_frame:
                    raise ParameterError(
                        f"{self.file}: {vehicle.name} has the {what} {frame}, which is the fixed "
                        "frame; expected another one"
                    )
        return fleet.at_ports(self.virtual_port) if self.virtual_port else fleet

    def own_names(self, fleet: FleetConfig) -> tuple[str, ...]:
        """Return the names of the vehicles that are flown here.

        `ParameterError`: no vehicle is flown here.
        """
        if self.machine == "*":
            return fleet.names
        names = tuple(v.name for v in fleet.vehicles if v.machine == self.machine)
        if not names:
            raise ParameterError(
                f"no vehicle of {self.file} is flown by the machine {self.machine!r}"
            )
        return names


class FlyParameters(FleetParameters):
    """Parameters of the process that flies vehicles."""

    is_simulated: bool = parameter(BOOLEAN, "also simulate the vehicles", name="simulated")
    is_vectorized: bool = parameter(
        BOOLEAN,
        "one simulator, estimator and controller for all simulated vehicles of one model with 7 "
        "states; otherwise each vehicle has its own, with all their parameters",
        True,
        "together",
    )
    downwash: bool = parameter(
        BOOLEAN,
        "whether simulated vehicles below others feel the air that those move; with the model "
        "quadrotor, or a type of vehicle, that has no lags",
        False,
    )
    fence: bool = parameter(
        BOOLEAN,
        "whether each vehicle has a geofence, whose box is in nodes/geofence/box, as with `fence: "
        "true` in the fleet file; of up to 21 vehicles, each also has half of the room between it "
        "and another",
        False,
    )
    common: Mapping[str, Any] = parameter(
        NODE_PARAMETERS, "parameters of every vehicle's nodes, node by node", name="nodes"
    )
    by_model: Mapping[str, Any] | None = parameter(
        NODE_PARAMETERS,
        "parameters of vehicles of one model, which override `vehicle`",
        None,
        "models",
    )
    extra_nodes: Mapping[str, type[Node]] | None = parameter(
        NODE_CLASSES, "more nodes of every vehicle, by their names below its own", None, "further"
    )
