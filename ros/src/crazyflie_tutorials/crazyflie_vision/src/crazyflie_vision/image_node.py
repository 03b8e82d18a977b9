"""What all nodes have in common that look at images."""

from typing import Any

from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from crazyflie_utils import Node, NodeHandle
from crazyflie_vision.images import to_array


class ImageNode(Node):
    """Base class of nodes that do something with every image of a topic."""

    def watch(self, handle: NodeHandle, topic: str) -> None:
        """Have `on_image` called for every image; those that cannot be read are named."""

        def convert(message: Image) -> None:
            try:
                image = to_array(message)
            except ValueError as error:
                handle.warn(f"ignoring {error}, on {handle.resolve(topic)}", throttle=5.0)
                return
            self.on_image(image, message.header)

        handle.subscribe(topic, Image, convert)

    def on_image(self, image: NDArray[Any], header: Header) -> None:
        """Do what the node is for.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width, 3)
            Blue, green, red.
        header : Header
            When it was taken, and the camera's optical frame.
        """
        raise NotImplementedError
