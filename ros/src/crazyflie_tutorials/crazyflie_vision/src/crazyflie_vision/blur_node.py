"""A node that makes images smoother."""

from typing import Any

from typing_extensions import override

from crazyflie_utils import parameter
from crazyflie_utils.parameters.types import Integer
from crazyflie_vision import filters
from crazyflie_vision.filter_node import FilterNode, FilterParameters


class OddInteger(Integer):
    """An odd whole number in [minimum, maximum]."""

    @override
    def __call__(self, value: Any) -> int:
        number = super().__call__(value)
        if number % 2 == 0:
            raise ValueError
        return number

    @override
    def __str__(self) -> str:
        return f"an odd integer from {self.minimum} to {self.maximum} ({self.unit})"


KERNEL = OddInteger(1, 99, "pixels")  #: Size of a square with a pixel in its middle.


class BlurParameters(FilterParameters):
    """Parameters of `BlurNode`."""

    size: int = parameter(KERNEL, "of the square that becomes one pixel", 9, live=True)


class BlurNode(FilterNode):
    """Publish smoother images."""

    parameters_type = BlurParameters
    _parameters: BlurParameters

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return filters.blur(image, self._parameters.size)
