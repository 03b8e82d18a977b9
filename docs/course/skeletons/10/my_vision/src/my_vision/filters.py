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

    The weights are those of ITU-R BT.601, by which eyes see green brighter than blue.
    """
    raise NotImplementedError("step 1")


def blur(image: Image, size: int) -> Image:
    """Return a smoother image: each pixel the mean of its neighbours, weighed by a Gaussian.

    Parameters
    ----------
    image : ndarray of uint8
        Coloured or grey.
    size : int
        Size of the square of neighbours (odd, pixels).
    """
    raise NotImplementedError("step 1")


def edges(image: Image, low: float, high: float, size: int) -> Image:
    """Return where brightness changes: 255 on an edge, elsewhere 0, shape (height, width).

    Canny, A Computational Approach to Edge Detection, 1986.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
    low, high : float
        A pixel whose gradient is above ``high`` begins an edge, which goes on over pixels above
        ``low``.
    size : int
        The image is blurred before, see `blur`; noise has edges, too.
    """
    raise NotImplementedError("step 1")


def threshold(image: Image, level: int) -> Image:
    """Return 255 where an image is brighter than a level, elsewhere 0, shape (height, width).

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
    level : int
        0 to 255.
    """
    raise NotImplementedError("step 1")
