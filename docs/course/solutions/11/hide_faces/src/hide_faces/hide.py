"""The algorithm: an image and a face in, an image without it out."""

from crazyflie_vision.filters import Image, blur
from crazyflie_vision.trackers import Target


def hide(image: Image, face: Target, size: int) -> Image:
    """Return a copy of an image in which the square around a face is blurred.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 3)
        Blue, green, red.
    face : Target
        Its centre and half its width, pixels.
    size : int
        Size of the blur (odd, pixels); see `crazyflie_vision.filters.blur`.
    """
    height, width = image.shape[:2]
    left, right = (round(min(max(face.x + s * face.radius, 0), width)) for s in (-1, 1))
    top, bottom = (round(min(max(face.y + s * face.radius, 0), height)) for s in (-1, 1))
    hidden = image.copy()
    hidden[top:bottom, left:right] = blur(image[top:bottom, left:right], size)
    return hidden
