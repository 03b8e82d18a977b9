"""ROS interface of the tracker of a thing of one colour."""

from typing import Any

from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer, Number
from crazyflie_vision.colour_tracker import ColourBounds, find
from crazyflie_vision.target import Target
from crazyflie_vision.tracker_node import TrackerNode, TrackerParameters

_HUE = Integer(0, 179)
_BYTE = Integer(0, 255)


class ColourTrackerParameters(TrackerParameters):
    """Parameters of `ColourTrackerNode`; the default colour is orange."""

    hue_lower: int = parameter(
        _HUE, "half degrees; larger than hue_upper for a range through red", 0, live=True
    )
    hue_upper: int = parameter(_HUE, "half degrees: 0 red, 60 green, 120 blue", 20, live=True)
    saturation_lower: int = parameter(_BYTE, "0 grey, 255 a pure colour", 140, live=True)
    saturation_upper: int = parameter(_BYTE, "likewise", 255, live=True)
    value_lower: int = parameter(_BYTE, "0 black, 255 bright", 70, live=True)
    value_upper: int = parameter(_BYTE, "likewise", 255, live=True)
    smallest_area: float = parameter(
        Number("pixels", minimum=1.0), "what is smaller is no target", 30.0, live=True
    )

    def bounds(self) -> ColourBounds:
        """Return the colours as the algorithm wants them."""
        return ColourBounds(
            self.hue_lower,
            self.hue_upper,
            self.saturation_lower,
            self.saturation_upper,
            self.value_lower,
            self.value_upper,
        )


class ColourTrackerNode(TrackerNode):
    """Publish where the largest thing of a colour is."""

    parameters_type = ColourTrackerParameters
    _parameters: ColourTrackerParameters

    @override
    def find(self, image: NDArray[Any]) -> Target | None:
        return find(image, self._parameters.bounds(), self._parameters.smallest_area)
