"""The algorithm: an image in, an image with lines out."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from crazyflie_vision import filters

RED = (0, 0, 255)


def find_lines(image: NDArray[Any], shortest: int) -> list[tuple[int, int, int, int]]:
    """Return the straight lines of an image, each as x, y of both ends, pixels.

    The probabilistic Hough transform of the image's edges (Matas, Galambos and Kittler, 2000).

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    shortest : int
        Length of the shortest line, pixels.
    """
    edges = filters.edges(image, low=40.0, high=120.0, size=3)
    found = cv2.HoughLinesP(
        edges, 1.0, math.pi / 180.0, threshold=40, minLineLength=shortest, maxLineGap=5
    )
    ends = np.empty((0, 4), dtype=int) if found is None else found.reshape(-1, 4)
    return [(int(x0), int(y0), int(x1), int(y1)) for x0, y0, x1, y1 in ends]


def draw_lines(image: NDArray[Any], shortest: int) -> NDArray[Any]:
    """Return an image on which its straight lines are red; see `find_lines`."""
    drawn = image.copy()
    for x0, y0, x1, y1 in find_lines(image, shortest):
        cv2.line(drawn, (x0, y0), (x1, y1), RED, thickness=2)
    return drawn
