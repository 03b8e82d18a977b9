"""Targets in images: an object of one colour, by the moments of its image; faces, by a cascade.

Viola and Jones, Rapid Object Detection using a Boosted Cascade of Simple Features, 2001.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import Integer

_INK = (0, 255, 0)
_SUBPIXEL_BITS = 4


@dataclass(frozen=True)
class Target:
    """A round object in an image; all in pixels."""

    #: x, y: Its centre, from the middle of the upper left pixel, to the right and down.
    x: float
    y: float
    radius: float


def draw(image: NDArray[Any], target: Target | None) -> NDArray[Any]:
    """Return a copy of an image in which a target is marked, and the image's middle."""
    drawn = image.copy()
    height, width = image.shape[:2]
    middle = ((width - 1) // 2, (height - 1) // 2)
    cv2.drawMarker(drawn, middle, (255, 255, 255), cv2.MARKER_CROSS, 14, 1)
    text = "nothing"
    if target is not None:
        x, y, radius = (
            round(value * 2**_SUBPIXEL_BITS) for value in (target.x, target.y, target.radius)
        )
        cv2.circle(drawn, (x, y), radius, _INK, 2, cv2.LINE_AA, _SUBPIXEL_BITS)
        centre = (round(target.x), round(target.y))
        cv2.drawMarker(drawn, centre, _INK, cv2.MARKER_CROSS, 8, 1)
        cv2.arrowedLine(drawn, middle, centre, (0, 255, 255), 1, cv2.LINE_AA, tipLength=0.1)
        text = f"x {target.x:.0f}  y {target.y:.0f}  radius {target.radius:.1f}"
    cv2.putText(drawn, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _INK, 1, cv2.LINE_AA)
    return drawn


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
        """Return 255 where an image (blue, green, red) has a colour in the range, elsewhere 0."""
        hsv = cv2.cvtColor(image, cv2.COLOR_BGR2HSV)
        if self.hue_lower <= self.hue_upper:
            return self._between(hsv, self.hue_lower, self.hue_upper)
        return self._between(hsv, self.hue_lower, 179) | self._between(hsv, 0, self.hue_upper)

    def _between(self, hsv, hue_lower, hue_upper):
        lower = (hue_lower, self.saturation_lower, self.value_lower)
        upper = (hue_upper, self.saturation_upper, self.value_upper)
        return cv2.inRange(hsv, lower, upper)


def largest_blob(mask: NDArray[Any]) -> NDArray[Any]:
    """Return a mask with the largest connected part of a mask only, without grains of noise."""
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), dtype=np.uint8))
    count, labels, figures, _ = cv2.connectedComponentsWithStats(opened)
    if count == 1:
        return opened
    # Label 0 is the background.
    largest = 1 + int(np.argmax(figures[1:, cv2.CC_STAT_AREA]))
    return np.where(labels == largest, np.uint8(255), np.uint8(0))


def find(image: NDArray[Any], bounds: ColourBounds, smallest_area: float) -> Target | None:
    """Return the largest object of a colour in an image, as a disc with its centre and area.

    With the moments m of its mask the centre is (m10 / m00, m01 / m00), and the area m00
    (Hu, Visual Pattern Recognition by Moment Invariants, 1962). An object of less than
    ``smallest_area`` (pixels) is not a target.
    """
    moments = cv2.moments(largest_blob(bounds.mask(image)), binaryImage=True)
    area = moments["m00"]
    if area < max(smallest_area, 1.0):
        return None
    return Target(moments["m10"] / area, moments["m01"] / area, math.sqrt(area / math.pi))


#: Trained for faces from the front; where Debian's opencv-data has it.
CASCADE = "/usr/share/opencv4/haarcascades/haarcascade_frontalface_default.xml"


class FaceDetector:
    """Finds the largest face in an image, by a cascade: a file with features and their weights.

    OSError: the file does not exist, or is not a cascade.
    """

    def __init__(self, cascade: str = CASCADE):
        self._cascade = cv2.CascadeClassifier()
        try:
            is_loaded = self._cascade.load(cascade)
        except cv2.error:
            is_loaded = False
        if not is_loaded:
            raise OSError(f"{cascade} is not a cascade; those of Debian are in opencv-data")

    def find(self, image: NDArray[Any], smallest: int = 24, neighbours: int = 4) -> Target | None:
        """Return the largest face in a coloured image, its radius half its width; None without.

        ``smallest`` is the width of the smallest face, pixels; the time that it takes is about 1 /
        smallest^2. ``neighbours`` is the number of overlapping finds that make a face; more of them
        miss more faces, and find fewer false ones.
        """
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        faces = self._cascade.detectMultiScale(grey, 1.1, neighbours, minSize=(smallest, smallest))
        if len(faces) == 0:
            return None
        x, y, width, height = (float(value) for value in max(faces, key=lambda face: face[2]))
        return Target(x + (width - 1.0) / 2.0, y + (height - 1.0) / 2.0, width / 2.0)
