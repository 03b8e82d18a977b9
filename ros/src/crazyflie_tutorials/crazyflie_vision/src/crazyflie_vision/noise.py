"""Noise of an image sensor."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

_MARGIN = 64


class PixelNoise:
    """Normally distributed noise, the same for every pixel and colour.

    Drawn once, on a larger image, of which every image gets another part: random numbers for
    every pixel of every image would take longer than drawing it.

    Parameters
    ----------
    width, height : int
        Of the images.
    deviation : float
        Standard deviation of a value from 0 to 255.
    seed : int
    """

    def __init__(self, width: int, height: int, deviation: float, seed: int = 0):
        self._random = np.random.default_rng(seed)
        shape = (height + _MARGIN, width + _MARGIN, 3)
        self._noise = np.round(self._random.normal(0.0, deviation, shape)).astype(np.int16)

    def add(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return an image with noise."""
        height, width = image.shape[:2]
        y, x = self._random.integers(_MARGIN, size=2)
        part = self._noise[y : y + height, x : x + width]
        return cv2.add(image, part, dtype=cv2.CV_8U)
