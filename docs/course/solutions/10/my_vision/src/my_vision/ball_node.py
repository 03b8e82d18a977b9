"""The node: images in, the ball out."""

from typing import Any

from geometry_msgs.msg import Point, PointStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import NodeHandle
from crazyflie_vision.images import ImageNode, to_message
from my_vision.trackers import ColourBounds, draw, find

SMALLEST_AREA = 30.0
"""Pixels."""


class BallNode(ImageNode):
    """Publish where the ball is, with the stamp of its image; nothing where it is not seen."""

    parameters_type = ColourBounds

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._target = handle.publisher("target", PointStamped)
        self._marked = handle.publisher("~image", Image)
        self.watch(handle, "camera/image_raw")

    @override
    def on_image(self, image: NDArray[Any], header: Header) -> None:
        target = find(image, self._parameters, SMALLEST_AREA)
        if self._marked.has_subscribers():
            self._marked.publish(to_message(draw(image, target), header))
        if target is not None:
            self._target.publish(PointStamped(header, Point(target.x, target.y, target.radius)))
