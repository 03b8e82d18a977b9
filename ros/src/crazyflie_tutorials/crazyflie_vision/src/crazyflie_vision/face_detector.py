"""Faces, found by a cascade of simple features.

Viola and Jones, Rapid Object Detection using a Boosted Cascade of Simple Features, 2001.
"""

from typing import Any

import cv2
from numpy.typing import NDArray

from crazyflie_vision.target import Target

#: Trained for faces from the front; where Debian's opencv-data has it.
CASCADE = "/usr/share/opencv4/haarcascades/haarcascade_frontalface_default.xml"


class FaceDetector:
    """Finds the largest face in an image.

    Parameters
    ----------
    cascade : str
        File with the features and their weights.
    smallest : int
        Width of the smallest face, pixels; the time that it takes is about 1 / smallest^2.
    neighbours : int
        How many overlapping finds make a face; more of them miss more faces, and find fewer where
        none is.

    Raises
    ------
    OSError
        The file is not there, or holds no cascade.
    """

    def __init__(self, cascade: str = CASCADE, smallest: int = 24, neighbours: int = 4):
        self._cascade = cv2.CascadeClassifier()
        try:
            is_loaded = self._cascade.load(cascade)
        except cv2.error:
            is_loaded = False
        if not is_loaded:
            raise OSError(f"{cascade} is no cascade; those of Debian are in opencv-data")
        self.smallest = smallest
        self.neighbours = neighbours

    def find(self, image: NDArray[Any]) -> Target | None:
        """Return the largest face, its radius being half its width; None for none.

        Parameters
        ----------
        image : ndarray of uint8, shape (height, width, 3)
            Blue, green, red.
        """
        grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        faces = self._cascade.detectMultiScale(
            grey, 1.1, self.neighbours, minSize=(self.smallest, self.smallest)
        )
        if len(faces) == 0:
            return None
        x, y, width, height = (float(value) for value in max(faces, key=lambda face: face[2]))
        return Target(x + (width - 1.0) / 2.0, y + (height - 1.0) / 2.0, width / 2.0)
