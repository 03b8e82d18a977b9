"""Where images come from that are not simulated: a webcam, a video file, a folder of images."""

import re
from pathlib import Path
from typing import Any

import cv2
from numpy.typing import NDArray

SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png")
"""Of images in a folder."""


class FrameSource:
    """Images, one after the other.

    Parameters
    ----------
    device : str
        A number or path of a camera, such as "0" or "/dev/video0"; or the path of a video, of an
        image, or of a folder of images, which are taken in the order of their names.
    width, height : int
        Of the images, pixels: asked of a camera, which may deliver another size; others are scaled.
    rate : float
        Images a second that are asked of a camera.

    Attributes
    ----------
    is_live : bool
        Whether it is a camera, whose images come in their own time.

    Raises
    ------
    OSError
        Nothing can be read there; the text says what there is.
    """

    def __init__(self, device: str, width: int, height: int, rate: float):
        self._device = device
        self._size = (width, height)
        self.is_live = device.isdecimal() or bool(re.match("/dev/", device))
        path = Path(device)
        if self.is_live:
            self._capture = _camera(device, width, height, rate)
        elif path.is_dir() or path.suffix.lower() in SUFFIXES:
            self._images = _images(path)
            self._next = 0
        elif path.is_file():
            self._capture = cv2.VideoCapture(device)
            if not self._capture.isOpened():
                raise OSError(f"{device} is no video that OpenCV can read")
        else:
            raise OSError(f"there is no camera, video, image or folder {device}")

    def read(self) -> NDArray[Any]:
        """Return the next image, shape (height, width, 3): blue, green, red.

        Waits for a camera; after the last image of a file or folder the first one comes again.

        Raises
        ------
        OSError
            There is none any more.
        """
        image = self._read()
        if image is None:
            raise OSError(f"no more images come from {self._device}")
        if self.is_live or (image.shape[1], image.shape[0]) == self._size:
            return image
        return cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)

    def close(self) -> None:
        """Let a camera go."""
        if self.is_live:
            self._capture.release()

    def _read(self):
        if hasattr(self, "_images"):
            self._next += 1
            return self._images[(self._next - 1) % len(self._images)]
        is_read, image = self._capture.read()
        if not is_read and not self.is_live:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            is_read, image = self._capture.read()
        return image if is_read else None


def _camera(device, width, height, rate):
    capture = cv2.VideoCapture(int(device) if device.isdecimal() else device)
    if not capture.isOpened():
        present = ", ".join(sorted(map(str, Path("/dev").glob("video*")))) or "none"
        raise OSError(f"there is no camera {device}, or it is in use; present: {present}")
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    capture.set(cv2.CAP_PROP_FPS, rate)
    return capture


def _images(path):
    paths = [path] if path.is_file() else sorted(path.iterdir()) if path.is_dir() else []
    paths = [each for each in paths if each.suffix.lower() in SUFFIXES]
    if not paths:
        raise OSError(f"there are no images ({', '.join(SUFFIXES)}) in {path}")
    images = [cv2.imread(str(each), cv2.IMREAD_COLOR) for each in paths]
    for each, image in zip(paths, images, strict=True):
        if image is None:
            raise OSError(f"{each} is no image that OpenCV can read")
    return images
