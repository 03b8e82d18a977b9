"""A node that makes images grey."""

from typing_extensions import override

from crazyflie_vision import filters
from crazyflie_vision.filter_node import FilterNode


class GreyNode(FilterNode):
    """Publish the brightness of images."""

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return filters.grey(image)
