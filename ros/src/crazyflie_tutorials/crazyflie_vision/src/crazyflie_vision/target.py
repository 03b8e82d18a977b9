"""What is followed: where it is in an image, and how large."""

from dataclasses import dataclass
from typing import Any

import cv2
from numpy.typing import NDArray

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
    cv2.drawMarker(drawn, centre, _INK, cv2.MARKER_CROSS, 8, 1)
    cv2.arrowedLine(drawn, middle, centre, (0, 255, 255), 1, cv2.LINE_AA, tipLength=0.1)
    text = f"x {target.x:.0f}  y {target.y:.0f}  radius {target.radius:.1f}"
    cv2.putText(drawn, text, (6, 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, _INK, 1, cv2.LINE_AA)
    return drawn
