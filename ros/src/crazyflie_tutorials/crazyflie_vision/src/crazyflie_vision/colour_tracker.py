"""A thing of one colour, found by that and by the moments of its image."""

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import Integer
from crazyflie_vision.target import Target

_HUE = Integer(0, 179)
_BYTE = Integer(0, 255)


class ColourBounds(Parameters):
    """A range of colours as OpenCV has them: hue 0 to 179 (half degrees), the others 0 to 255.

    A lower hue that is larger than the upper one means a range that goes through red, where hue
    begins again. The default is orange.
    """

    hue_lower: int = parameter(
        _HUE, "half degrees; larger than hue_upper for a range through red", 0, live=True
    )
    hue_upper: int = parameter(_HUE, "half degrees: 0 red, 60 green, 120 blue", 20, live=True)
    saturation_lower: int = parameter(_BYTE, "0 grey, 255 a pure colour", 140, live=True)
    saturation_upper: int = parameter(_BYTE, "likewise", 255, live=True)
    value_lower: int = parameter(_BYTE, "0 black, 255 bright", 70, live=True)
    value_upper: int = parameter(_BYTE, "likewise", 255, live=True)

    def mask(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return 255 where an image (blue, green, red) has such a colour, elsewhere 0."""
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        if self.hue_lower <= self.hue_upper:
            return self._between(hsv, self.hue_lower, self.hue_upper)
        return self._between(hsv, self.hue_lower, 179) | self._between(hsv, 0, self.hue_upper)

    def _between(self, hsv, hue_lower, hue_upper):
        lower = (hue_lower, self.saturation_lower, self.value_lower)
        upper = (hue_upper, self.saturation_upper, self.value_upper)
        return cv2.inRange(hsv, lower, upper)


def largest_blob(mask: NDArray[Any]) -> NDArray[Any]:
    """Return a mask with the largest connected part of a mask only, grains of noise taken off."""
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8))
    count, labels, figures, _ = cv2.connectedComponentsWithStats(opened)
    if count == 1:
        return opened
    # Label 0 is what is not in the mask.
    largest = 1 + int(np.argmax(figures[1:, cv2.CC_STAT_AREA]))
    return np.where(labels == largest, np.uint8(255), np.uint8(0))


def find(image: NDArray[Any], bounds: ColourBounds, smallest_area: float) -> Target | None:
    """Return the largest thing of a colour in an image, as a disc with its centre and area.

    With the moments m of its mask the centre is (m10 / m00, m01 / m00), and the area m00
    (Hu, Visual Pattern Recognition by Moment Invariants, 1962).

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    bounds : ColourBounds
    smallest_area : float
        What is smaller is none, pixels.
    """
    moments = cv2.moments(largest_blob(bounds.mask(image)), binaryImage=True)
    area = moments["m00"]
    if area < max(smallest_area, 1.0):
        return None
    return Target(moments["m10"] / area, moments["m01"] / area, math.sqrt(area / math.pi))
