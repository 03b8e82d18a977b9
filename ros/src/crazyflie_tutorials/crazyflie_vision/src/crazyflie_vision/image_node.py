"""The ROS interface that filters and trackers share: images in."""

from typing import Any, ClassVar

from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters
from crazyflie_vision.images import to_array


class ImageNode(Node):
    """Base class of nodes that process every image of a topic: has ``parameters_type``."""

    parameters_type: ClassVar[type[Parameters]]

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(self.parameters_type, self._reconfigure)

    def _reconfigure(self, parameters: Any) -> None:
        self._parameters = parameters

    def watch(self, handle: NodeHandle, topic: str) -> None:
        """Call `on_image` for every image; log those that cannot be read."""

        def convert(message: Image) -> None:
            try:
                image = to_array(message)
            except ValueError as error:
                handle.warn(f"ignoring {error}, on {handle.resolve(topic)}", throttle=5.0)
                return
            self.on_image(image, message.header)

        handle.subscribe(topic, Image, convert)

    def on_image(self, image: NDArray[Any], header: Header) -> None:
        """Process an image.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width, 3)
            Blue, green, red.
        header : Header
            When it was taken, and the camera's optical frame.
        """
        raise NotImplementedError
