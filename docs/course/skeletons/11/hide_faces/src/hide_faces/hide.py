"""The algorithm: an image and a face in, an image without it out."""

from crazyflie_vision.filters import Image
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
    raise NotImplementedError("blur the square, and nothing else")
