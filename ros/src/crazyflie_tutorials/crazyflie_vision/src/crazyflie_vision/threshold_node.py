"""A node that separates bright from dark pixels."""

from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer
from crazyflie_vision import filters
from crazyflie_vision.filter_node import FilterNode, FilterParameters


class ThresholdParameters(FilterParameters):
    """Parameters of `ThresholdNode`."""

    level: int = parameter(Integer(0, 255), "what is brighter becomes white", 128, live=True)


class ThresholdNode(FilterNode):
    """Publish black and white."""

    parameters_type = ThresholdParameters
    _parameters: ThresholdParameters

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return filters.threshold(image, self._parameters.level)
