"""ROS interface of the face detector."""

from typing import Any

from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_utils import NodeHandle, ParameterError, parameter
from crazyflie_utils.parameters.types import TEXT, Integer
from crazyflie_vision.face_detector import CASCADE, FaceDetector
from crazyflie_vision.target import Target
from crazyflie_vision.tracker_node import TrackerNode, TrackerParameters


class FaceDetectorParameters(TrackerParameters):
    """Parameters of `FaceDetectorNode`."""

    cascade: str = parameter(TEXT, "file of the cascade", CASCADE)
    smallest: int = parameter(
        Integer(20, 1000, "pixels"), "width of the smallest face", 30, live=True
    )
    neighbours: int = parameter(
        Integer(1, 50), "finds that make a face; more of them, fewer mistakes", 4, live=True
    )


class FaceDetectorNode(TrackerNode):
    """Publish where the largest face is."""

    parameters_type = FaceDetectorParameters
    _parameters: FaceDetectorParameters

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        each = self._parameters
        try:
            self._detector = FaceDetector(each.cascade, each.smallest, each.neighbours)
        except OSError as error:
            raise ParameterError(f"parameter {handle.resolve('~cascade')}: {error}") from None

    @override
    def find(self, image: NDArray[Any]) -> Target | None:
        return self._detector.find(image)

    @override
    def _reconfigure(self, parameters):
        super()._reconfigure(parameters)
        self._detector.smallest = parameters.smallest
        self._detector.neighbours = parameters.neighbours
