"""The node: a filter of crazyflie_vision."""

from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer
from crazyflie_vision import filters
from crazyflie_vision.filter_nodes import FilterNode, FilterParameters
from line_filter.lines import draw_lines


class LineFilterParameters(FilterParameters):
    """Parameters of `LineFilterNode`."""

    shortest: int = parameter(
        Integer(1, 4096), "length of the shortest line, pixels", 40, live=True
    )


class LineFilterNode(FilterNode):
    """Publish images on which straight lines are red."""

    parameters_type = LineFilterParameters
    _parameters: LineFilterParameters

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return draw_lines(image, self._parameters.shortest)
