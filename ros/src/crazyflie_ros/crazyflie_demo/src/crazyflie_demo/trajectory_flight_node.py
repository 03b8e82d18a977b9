"""ROS interface of a flight along a trajectory."""

from crazyflie_demo.flight_plan_node import FlightPlanNode, Step, seconds
from crazyflie_demo.trajectory_file import TrajectoryError, load, summary
from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import (
    StartTrajectory,
    StartTrajectoryRequest,
    UploadTrajectory,
    UploadTrajectoryRequest,
)
from crazyflie_utils.parameter_types import BOOLEAN, TEXT, Number
from crazyflie_utils.parameters import ParameterError


class TrajectoryFlightNode(FlightPlanNode):
    """Take off, fly along the trajectory of a file from there on, land."""

    def __init__(self):
        super().__init__()
        self._pieces = None
        self._time_scale = None
        self._is_reversed = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        super().load_parameters(handle)
        path = handle.param("file", TEXT)
        try:
            self._pieces = load(path)
        except TrajectoryError as error:
            raise ParameterError(f"parameter {handle.resolve('~file')}: {error}") from None
        self._time_scale = handle.param("timescale", Number(above=0.0, maximum=100.0), 1.0)
        self._is_reversed = handle.param("reversed", BOOLEAN, False)
        asked = summary(self._pieces)
        scale = self._time_scale
        handle.info(
            f"{path}: {asked.duration * scale:.1f} s, up to {asked.speed / scale:.2f} m/s and "
            f"{asked.acceleration / scale**2:.2f} m/s^2"
        )

    def preparations(self) -> list[Step]:
        """See `FlightPlanNode.preparations`."""
        pieces = [
            TrajectoryPolynomialPiece(*piece.axes, seconds(piece.duration))
            for piece in self._pieces
        ]
        return [Step("upload_trajectory", UploadTrajectory, UploadTrajectoryRequest(pieces=pieces))]

    def manoeuvres(self) -> list[Step]:
        """See `FlightPlanNode.manoeuvres`."""
        request = StartTrajectoryRequest(
            timescale=self._time_scale, reversed=self._is_reversed, relative=True
        )
        duration = summary(self._pieces).duration * self._time_scale
        return [Step("start_trajectory", StartTrajectory, request, duration)]
