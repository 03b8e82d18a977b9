"""Images between messages and OpenCV, and the base class of nodes that process them."""

from typing import Any

import cv2
import numpy as np
from cv_bridge import CvBridge, CvBridgeError
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from crazyflie_utils import Node, NodeHandle
from crazyflie_utils.node import P
from crazyflie_vision.camera import Pinhole

COLOUR = "bgr8"
GREY = "mono8"

_BRIDGE = CvBridge()


def to_array(message: Image) -> NDArray[np.uint8]:
    """Return the pixels of an image, shape (height, width, 3): blue, green, red.

    ValueError: its encoding has no such colours, or its data are too short.
    """
    what = f"an image of {message.width} x {message.height}, {message.encoding!r}"
    if message.width == 0 or message.height == 0:
        raise ValueError(f"{what}: the image is empty")
    try:
        return _BRIDGE.imgmsg_to_cv2(message, COLOUR)
    except (CvBridgeError, TypeError, cv2.error) as error:
        raise ValueError(f"{what}: {error}") from None


def to_message(image: NDArray[np.uint8], header: Header) -> Image:
    """Return a message with an image, grey if its shape is (height, width), and a header."""
    encoding = GREY if image.ndim == 2 else COLOUR
    height, width = image.shape[:2]
    # cv_bridge's cv2_to_imgmsg fails with NumPy 2.3, which Debian's sid has.
    return Image(header, height, width, encoding, 0, image[0].nbytes, image.tobytes())


def camera_info(camera: Pinhole, header: Header) -> CameraInfo:
    """Return the message that describes a camera; without distortion."""
    k = camera.matrix
    message = CameraInfo(header=header, width=camera.width, height=camera.height)
    message.distortion_model = "plumb_bob"
    message.D = [0.0] * 5
    message.K = k.ravel().tolist()
    message.R = np.eye(3).ravel().tolist()
    message.P = np.hstack([k, np.zeros((3, 1))]).ravel().tolist()
    return message


class ImageNode(Node[P]):
    """Base class of nodes that process every image of a topic."""

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
        """Process an image; see `to_array`.

        The header has the time at which it was taken, and the camera's optical frame.
        """
        raise NotImplementedError
