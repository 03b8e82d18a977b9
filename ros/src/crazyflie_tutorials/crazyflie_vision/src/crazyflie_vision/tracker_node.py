"""Image in, target out: the ROS interface that all trackers share."""

from typing import Any

from geometry_msgs.msg import Point, PointStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC
from crazyflie_vision.image_node import ImageNode
from crazyflie_vision.images import to_message
from crazyflie_vision.target import Target, draw


class TrackerParameters(Parameters):
    """Parameters that all trackers have."""

    image_topic: str = parameter(
        TOPIC, "images to look at", "camera/image_raw", name="topics/image"
    )
    target_topic: str = parameter(
        TOPIC, "what is seen: x, y and, as z, radius in pixels", "target", name="topics/target"
    )
    debug_topic: str = parameter(
        TOPIC, "images with the target marked", "~image", name="topics/debug_image"
    )


class TrackerNode(ImageNode):
    """Base class: a tracker has ``parameters_type``, and `find`.

    A target is published with the stamp of its image; where nothing is found, nothing is.
    """

    _parameters: TrackerParameters
    needed_in_flight = True

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._target = handle.publisher(self._parameters.target_topic, PointStamped)
        self._debug = handle.publisher(self._parameters.debug_topic, Image)
        self.watch(handle, self._parameters.image_topic)

    def find(self, image: NDArray[Any]) -> Target | None:
        """Return what is followed; None where it is not seen."""
        raise NotImplementedError

    @override
    def on_image(self, image: NDArray[Any], header: Header) -> None:
        target = self.find(image)
        if target is not None:
            point = Point(target.x, target.y, target.radius)
            self._target.publish(PointStamped(header, point))
        if self._debug.has_subscribers():
            self._debug.publish(to_message(draw(image, target), header))
