"""The first steps with images: each a function from an image to an image.

An image is an array of uint8: shape (height, width, 3), blue, green, red, or (height, width),
grey from 0 (black) to 255 (white).
"""

from typing import Any

import cv2
from numpy.typing import NDArray

Image = NDArray[Any]


def grey(image: Image) -> Image:
    """Return the brightness of a coloured image: 0.299 red + 0.587 green + 0.114 blue.

    The weights are those of ITU-R BT.601: to the eye, green is brighter than blue.
    """
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)


def blur(image: Image, size: int) -> Image:
    """Return a smoother image: each pixel the mean of its neighbours, weighed by a Gaussian.

    ``size`` is that of the square of neighbours; odd, pixels.
    """
    return cv2.GaussianBlur(image, (size, size), 0.0)


def edges(image: Image, low: float, high: float, size: int) -> Image:
    """Return where brightness changes: 255 on an edge, elsewhere 0, shape (height, width).

    Canny, A Computational Approach to Edge Detection, 1986. A pixel of the coloured image whose
    gradient is above ``high`` begins an edge, which continues over pixels above ``low``. The image
    is blurred first, see `blur`, since noise also has edges.
    """
    return cv2.Canny(blur(grey(image), size), low, high)


def threshold(image: Image, level: int) -> Image:
    """Return 255 where a coloured image is brighter than a level (0 to 255), elsewhere 0."""
    return cv2.threshold(grey(image), level, 255, cv2.THRESH_BINARY)[1]
