"""Converts pictures of cameras to formats that a browser shows."""

import io
from typing import Any

import numpy as np
from PIL import Image

_MAX_WIDTH = 640  #: Largest picture; larger ones are reduced (pixels).
_QUALITY = 80  #: Quality of JPEG (%).

#: Encoding of sensor_msgs/Image -> Pillow's modes of the picture and of the data, whose order of
#: bytes is filled in, and bytes of a pixel; a single channel of more than a byte is scaled to its
#: range.
_ENCODINGS: dict[str, tuple[str, str, int]] = {
    "bgr8": ("RGB", "BGR", 3),
    "bgra8": ("RGB", "BGRX", 4),
    "rgb8": ("RGB", "RGB", 3),
    "rgba8": ("RGB", "RGBX", 4),
    "8UC3": ("RGB", "BGR", 3),
    **dict.fromkeys(("mono8", "8UC1"), ("L", "L", 1)),
    **dict.fromkeys(("mono16", "16UC1"), ("F", "F;16{}", 2)),
    "32FC1": ("F", "F;32{}F", 4),
}


def encoded(message: Any) -> bytes:
    """Return a sensor_msgs/Image or CompressedImage as JPEG or PNG.

    `ValueError`: it cannot be shown; the text says why.
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
    mode, pixel, size = _ENCODINGS[message.encoding]
    height, width, step = message.height, message.width, message.step
    if len(message.data) < height * step or step < width * size or not height * width:
        raise ValueError(
            f"it has {len(message.data)} bytes for {height} rows of {width}; expected "
            f"{height * max(step, width * size)}, and some"
        )
    pixel = pixel.format("B" if message.is_bigendian else "")
    picture = Image.frombytes(mode, (width, height), message.data, "raw", pixel, step)
    if width > _MAX_WIDTH:
        height = max(1, round(height * _MAX_WIDTH / width))
        picture = picture.resize((_MAX_WIDTH, height), Image.Resampling.BOX)
    if mode == "F":
        picture = Image.fromarray(_in_bytes(np.asarray(picture)))
    file = io.BytesIO()
    try:
        picture.save(file, "JPEG", quality=_QUALITY)
    except OSError:
        raise ValueError(f"{width} x {height} pixels cannot be encoded as JPEG") from None
    return file.getvalue()


def _in_bytes(numbers):
    known = numbers[np.isfinite(numbers)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
    scaled = (np.nan_to_num(numbers, nan=low, posinf=high, neginf=low) - low) * 255.0
    return (scaled / max(high - low, 1e-9)).astype(np.uint8)
