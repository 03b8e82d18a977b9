"""ROS interface of the tracker of a thing of one colour."""

from typing import Any

from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Number
from crazyflie_vision.colour_tracker import ColourBounds, find
from crazyflie_vision.target import Target
from crazyflie_vision.tracker_node import TrackerNode, TrackerParameters


class ColourTrackerParameters(ColourBounds, TrackerParameters):
    """Parameters of `ColourTrackerNode`."""

    smallest_area: float = parameter(
        Number("pixels", minimum=1.0), "what is smaller is no target", 30.0, live=True
    )


class ColourTrackerNode(TrackerNode):
    """Publish where the largest thing of a colour is."""

    parameters_type = ColourTrackerParameters
    _parameters: ColourTrackerParameters

    @override
    def find(self, image: NDArray[Any]) -> Target | None:
        return find(image, self._parameters, self._parameters.smallest_area)
