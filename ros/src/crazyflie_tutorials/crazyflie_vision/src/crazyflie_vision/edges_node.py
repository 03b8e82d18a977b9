"""A node that finds edges in images."""

from collections.abc import Iterator

from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Number
from crazyflie_vision import filters
from crazyflie_vision.blur_node import KERNEL
from crazyflie_vision.filter_node import FilterNode, FilterParameters

_GRADIENT = Number(minimum=0.0, maximum=5000.0)


class EdgesParameters(FilterParameters):
    """Parameters of `EdgesNode`."""

    low: float = parameter(_GRADIENT, "an edge goes on above this gradient", 40.0, live=True)
    high: float = parameter(_GRADIENT, "an edge begins above this gradient", 120.0, live=True)
    size: int = parameter(KERNEL, "of the square that is blurred before", 3, live=True)

    @override
    def complaints(self) -> Iterator[str]:
        if self.low > self.high:
            yield f"low is {self.low:g}; expected <= high, {self.high:g}"


class EdgesNode(FilterNode):
    """Publish where brightness changes."""

    parameters_type = EdgesParameters
    _parameters: EdgesParameters

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        parameters = self._parameters
        return filters.edges(image, parameters.low, parameters.high, parameters.size)
