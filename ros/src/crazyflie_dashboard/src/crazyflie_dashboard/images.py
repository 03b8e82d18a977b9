"""Converts pictures of cameras to formats that a browser shows."""

from typing import Any

import cv2
import numpy as np

_MAX_WIDTH = 640  #: Largest picture; larger ones are reduced (pixels).
_QUALITY = 80  #: Quality of JPEG (%).

#: Encoding of sensor_msgs/Image -> type of a number, and indices of blue, green and red; a single
#: channel of more than a byte is scaled to its range.
_ENCODINGS: dict[str, tuple[str, list[int]]] = {
    "bgr8": ("u1", [0, 1, 2]),
    "bgra8": ("u1", [0, 1, 2, 3]),
    "rgb8": ("u1", [2, 1, 0]),
    "rgba8": ("u1", [2, 1, 0, 3]),
    "8UC3": ("u1", [0, 1, 2]),
    **dict.fromkeys(("mono8", "8UC1"), ("u1", [0])),
    **dict.fromkeys(("mono16", "16UC1"), ("u2", [0])),
    "32FC1": ("f4", [0]),
}


def encoded(message: Any) -> bytes:
    """Return a sensor_msgs/Image or CompressedImage as JPEG or PNG.

    Raises
    ------
    ValueError
        It cannot be shown; the text says why.
    """
    if not hasattr(message, "encoding"):
        data = bytes(message.data)
        # Only formats that a browser shows directly reach a page.
        if not data.startswith((b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n")):
            raise ValueError(f"its format is {message.format}; expected JPEG or PNG")
        return data
    if message.encoding not in _ENCODINGS:
        raise ValueError(
            f"its encoding is {message.encoding}; expected one of {', '.join(_ENCODINGS)}"
        )
    kind, order = _ENCODINGS[message.encoding]
    number = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = message.height, message.width, message.step
    row = width * len(order) * number.itemsize
    if len(message.data) < height * step or step < row or not height * width:
        raise ValueError(
            f"it has {len(message.data)} bytes for {height} rows of {width}; expected "
            f"{height * max(step, row)}, and some"
        )
    rows = np.frombuffer(message.data, np.uint8, height * step).reshape(height, step)[:, :row]
    picture: Any = np.ascontiguousarray(rows).view(number).reshape(height, width, len(order))
    picture = picture[..., order[:3]]
    scale = _MAX_WIDTH / width
    if scale < 1.0:
        size = (_MAX_WIDTH, max(1, round(height * scale)))
        native = picture.astype(number.newbyteorder("="), copy=False)
        picture = cv2.resize(native, size, interpolation=cv2.INTER_AREA)
    if number.itemsize > 1:
        picture = _in_bytes(picture.astype(float))
    is_done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    if not is_done:
        raise ValueError(f"{width} x {height} pixels cannot be encoded as JPEG")
    return data.tobytes()


def _in_bytes(numbers):
    known = numbers[np.isfinite(numbers)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
    scaled = (np.nan_to_num(numbers, nan=low, posinf=high, neginf=low) - low) * 255.0
    return (scaled / max(high - low, 1e-9)).astype(np.uint8)
