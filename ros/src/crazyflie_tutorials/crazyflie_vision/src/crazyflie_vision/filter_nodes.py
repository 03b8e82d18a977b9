"""Image in, image out: the ROS interfaces of the filters."""

from collections.abc import Iterator
from typing import Any

from sensor_msgs.msg import Image
from std_msgs.msg import Header
from typing_extensions import TypeVar, override

from crazyflie_utils import NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import Integer, Number
from crazyflie_vision import filters
from crazyflie_vision.images import ImageNode, to_message


class FilterParameters(Parameters):
    """Parameters that all filters have."""

    image_topic: str = topic("image", "input images", "camera/image_raw")
    result_topic: str = topic("result", "resulting images", "~image")


F = TypeVar("F", bound=FilterParameters, default=FilterParameters)


class FilterNode(ImageNode[F]):
    """Base class: a filter has parameters, and `apply`."""

    parameters_type = FilterParameters

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self._parameters.result_topic, Image)
        self.watch(handle, self._parameters.image_topic)

    def apply(self, image: filters.Image) -> filters.Image:
        """Return the filtered image; see `filters`."""
        raise NotImplementedError

    @override
    def on_image(self, image: filters.Image, header: Header) -> None:
        if self._publisher.has_subscribers():
            self._publisher.publish(to_message(self.apply(image), header))


class GreyNode(FilterNode):
    """Publish the brightness of images."""

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return filters.grey(image)


class ThresholdParameters(FilterParameters):
    """Parameters of `ThresholdNode`."""

    level: int = parameter(
        Integer(0, 255), "brightness above which pixels become white", 128, live=True
    )


class ThresholdNode(FilterNode[ThresholdParameters]):
    """Publish images in black and white."""

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return filters.threshold(image, self._parameters.level)


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


KERNEL = OddInteger(1, 99, "pixels")  #: Size of a square with a pixel at its centre.


class BlurParameters(FilterParameters):
    """Parameters of `BlurNode`."""

    size: int = parameter(KERNEL, "size of the square that is averaged for a pixel", 9, live=True)


class BlurNode(FilterNode[BlurParameters]):
    """Publish smoother images."""

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        return filters.blur(image, self._parameters.size)


_GRADIENT = Number(minimum=0.0, maximum=5000.0)


class EdgesParameters(FilterParameters):
    """Parameters of `EdgesNode`."""

    low: float = parameter(_GRADIENT, "gradient above which an edge continues", 40.0, live=True)
    high: float = parameter(_GRADIENT, "gradient above which an edge begins", 120.0, live=True)
    size: int = parameter(
        KERNEL, "size of the square by which the image is blurred first", 3, live=True
    )

    @override
    def complaints(self) -> Iterator[str]:
        if self.low > self.high:
            yield f"low is {self.low:g}; expected <= high, {self.high:g}"


class EdgesNode(FilterNode[EdgesParameters]):
    """Publish the edges of images."""

    @override
    def apply(self, image: filters.Image) -> filters.Image:
        parameters = self._parameters
        return filters.edges(image, parameters.low, parameters.high, parameters.size)
