"""ROS interface of a flight along a trajectory."""

from typing_extensions import override

from crazyflie_demo.flight_plan_node import FlightPlanNode, FlightPlanParameters, Step, seconds
from crazyflie_demo.trajectory_file import load, summary
from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import (
    StartTrajectory,
    StartTrajectoryRequest,
    UploadTrajectory,
    UploadTrajectoryRequest,
)
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_utils import NodeHandle, parameter
from crazyflie_utils.parameters.types import BOOLEAN, File, Number


class TrajectoryFlightParameters(FlightPlanParameters):
    """Parameters of `TrajectoryFlightNode`."""

    pieces: list[PolynomialPiece] = parameter(
        File(load, "a CSV file with a trajectory"), "CSV file of the trajectory", name="file"
    )
    timescale: float = parameter(
        Number(above=0.0, maximum=100.0), "2 takes twice as long as the file says", 1.0
    )
    reversed: bool = parameter(BOOLEAN, "fly from the end to the beginning", False)


class TrajectoryFlightNode(FlightPlanNode):
    """Take off, fly along the trajectory of a file from there on, land."""

    _parameters: TrajectoryFlightParameters

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(TrajectoryFlightParameters)
        asked = summary(self._parameters.pieces)
        scale = self._parameters.timescale
        handle.info(
            f"the trajectory takes {asked.duration * scale:.1f} s, up to "
            f"{asked.speed / scale:.2f} m/s and {asked.acceleration / scale**2:.2f} m/s^2"
        )

    @override
    def preparations(self) -> list[Step]:
        pieces = [
            TrajectoryPolynomialPiece(*piece.axes, seconds(piece.duration))
            for piece in self._parameters.pieces
        ]
        return [Step("upload_trajectory", UploadTrajectory, UploadTrajectoryRequest(pieces=pieces))]

    @override
    def manoeuvres(self) -> list[Step]:
        parameters = self._parameters
        request = StartTrajectoryRequest(
            timescale=parameters.timescale, reversed=parameters.reversed, relative=True
        )
        duration = summary(parameters.pieces).duration * parameters.timescale
        return [Step("start_trajectory", StartTrajectory, request, duration)]
