"""The algorithm: an image in, an image with lines out."""

from typing import Any

from numpy.typing import NDArray

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
    raise NotImplementedError("step 1")


def draw_lines(image: NDArray[Any], shortest: int) -> NDArray[Any]:
    """Return an image on which its straight lines are red; see `find_lines`."""
    raise NotImplementedError("step 2")
