"""A thing of one colour in images, by the moments of its image."""

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
    """A round thing in an image; all in pixels."""

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
    if target is None:
        cv2.putText(drawn, "nothing", (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _INK, 1, cv2.LINE_AA)
        return drawn
    x, y, radius = (
        round(value * 2**_SUBPIXEL_BITS) for value in (target.x, target.y, target.radius)
    )
    cv2.circle(drawn, (x, y), radius, _INK, 2, cv2.LINE_AA, _SUBPIXEL_BITS)
    centre = (round(target.x), round(target.y))
    # Step 4: mark the centre with a cross of the colour _INK, 8 pixels wide.
    cv2.arrowedLine(drawn, middle, centre, (0, 255, 255), 1, cv2.LINE_AA, tipLength=0.1)
    text = f"x {target.x:.0f}  y {target.y:.0f}  radius {target.radius:.1f}"
    cv2.putText(drawn, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _INK, 1, cv2.LINE_AA)
    return drawn


_HUE = Integer(0, 179)
_BYTE = Integer(0, 255)


# Step 5: make these six parameters live.
class ColourBounds(Parameters):
    """A range of colours as OpenCV has them: hue 0 to 179 (half degrees), the others 0 to 255.

    A lower hue that is larger than the upper one means a range that goes through red, where hue
    begins again. The default is orange.
    """

    hue_lower: int = parameter(
        _HUE, "half degrees; larger than hue_upper for a range through red", 0
    )
    hue_upper: int = parameter(_HUE, "half degrees: 0 red, 60 green, 120 blue", 20)
    saturation_lower: int = parameter(_BYTE, "0 grey, 255 a pure colour", 140)
    saturation_upper: int = parameter(_BYTE, "likewise", 255)
    value_lower: int = parameter(_BYTE, "0 black, 255 bright", 70)
    value_upper: int = parameter(_BYTE, "likewise", 255)

    def mask(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return 255 where an image (blue, green, red) has such a colour, elsewhere 0."""
        raise NotImplementedError("step 2")


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
        Area below which a thing is not a target (pixels).
    """
    raise NotImplementedError("step 3")
