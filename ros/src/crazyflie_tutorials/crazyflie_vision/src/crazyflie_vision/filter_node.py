"""Image in, image out: the ROS interface that all filters share."""

from typing import ClassVar

from sensor_msgs.msg import Image
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC
from crazyflie_vision import filters
from crazyflie_vision.image_node import ImageNode
from crazyflie_vision.images import to_message


class FilterParameters(Parameters):
    """Parameters that all filters have."""

    image_topic: str = parameter(
        TOPIC, "images to work on", "camera/image_raw", name="topics/image"
    )
    result_topic: str = parameter(TOPIC, "where results go", "~image", name="topics/result")


class FilterNode(ImageNode):
    """Base class: a filter has ``parameters_type``, and `apply`."""

    parameters_type: ClassVar[type[FilterParameters]] = FilterParameters
    _parameters: FilterParameters

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self._parameters.result_topic, Image)
        self.watch(handle, self._parameters.image_topic)

    def apply(self, image: filters.Image) -> filters.Image:
        """Return what the filter makes of an image; see `filters`."""
        raise NotImplementedError

    @override
    def on_image(self, image: filters.Image, header: Header) -> None:
        if self._publisher.has_subscribers():
            self._publisher.publish(to_message(self.apply(image), header))
