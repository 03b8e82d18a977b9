"""Pictures of cameras as a browser shows them."""

import contextlib
from typing import Any

import cv2
import numpy as np

_MAX_WIDTH = 640  #: Larger pictures are made smaller, pixels.
_QUALITY = 80  #: Of JPEG, percent.

_CHANNELS = {"rgb8": 3, "bgr8": 3, "rgba8": 4, "bgra8": 4, "mono8": 1, "8UC1": 1, "8UC3": 3}


def encoded(message: Any) -> bytes | None:
    """Return a sensor_msgs/Image or CompressedImage as JPEG or PNG; None if it cannot be read."""
    if not hasattr(message, "encoding"):
        data = bytes(message.data)
        # What a browser shows as it is; nothing else reaches a page.
        return data if data.startswith((b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n")) else None
    with contextlib.suppress(ValueError, cv2.error):
        return _encoded(message)
    return None


def _encoded(message):
    channels = _CHANNELS.get(message.encoding)
    if channels is None or message.height == 0 or message.width == 0:
        return None
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    picture: Any = rows[:, : message.width * channels].reshape(
        message.height, message.width, channels
    )
    if message.encoding.startswith("rgb"):
        picture = picture[:, :, [2, 1, 0]]
    scale = _MAX_WIDTH / message.width
    if scale < 1.0:
        size = (_MAX_WIDTH, max(1, round(message.height * scale)))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    is_done, data = cv2.imencode(".jpg", picture[..., :3], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    return data.tobytes() if is_done else None
