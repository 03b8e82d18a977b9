"""The node: a filter of crazyflie_vision."""

from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_vision import filters
from crazyflie_vision.filter_nodes import KERNEL, FilterNode, FilterParameters
from crazyflie_vision.trackers import FaceDetector
from hide_faces.hide import hide


class HideFacesParameters(FilterParameters):
    """Parameters of `HideFacesNode`."""

    size: int = parameter(KERNEL, "size of the square that is averaged for a pixel", 75, live=True)


class HideFacesNode(FilterNode):
    """Publish images in which the largest face cannot be told."""

    parameters_type = HideFacesParameters
    _parameters: HideFacesParameters

    def __init__(self) -> None:
        self._detector = FaceDetector()

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        face = self._detector.find(image)
        return image if face is None else hide(image, face, self._parameters.size)
