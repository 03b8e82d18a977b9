"""Sources of images that are not simulated: a webcam, a video, a folder of pictures."""

import itertools
from pathlib import Path
from typing import Any, ClassVar

import cv2
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_vision.renderer import load_picture

SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png")  #: Suffixes of pictures in a folder.


class FrameSource:
    """Images, one after the other."""

    is_live: ClassVar[bool] = False  #: Whether images come at the source's own rate.

    def read(self) -> NDArray[Any]:
        """Return the next image, shape (height, width, 3): blue, green, red.

        OSError: the source has ended.
        """
        raise NotImplementedError


class Webcam(FrameSource):
    """A camera, by its number or path, such as "0" or "/dev/video0".

    Width, height (pixels) and rate (1/s) are requested; the camera may deliver others. OSError if
    it cannot be used; the text names the available cameras.
    """

    is_live = True

    def __init__(self, device: str, width: int, height: int, rate: float):
        self._device = device
        self._capture = cv2.VideoCapture(int(device) if device.isdecimal() else device)
        if not self._capture.isOpened():
            present = ", ".join(sorted(map(str, Path("/dev").glob("video*")))) or "none"
            raise OSError(f"the camera {device} does not exist, or is in use; available: {present}")
        self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
        self._capture.set(cv2.CAP_PROP_FPS, rate)

    @override
    def read(self) -> NDArray[Any]:
        is_read, image = self._capture.read()
        if not is_read:
            raise OSError(f"camera {self._device} gives no more images; was it unplugged?")
        return image


class Video(FrameSource):
    """A video file, in a loop; OSError if OpenCV cannot read it."""

    def __init__(self, path: Path):
        self._path = path
        self._capture = cv2.VideoCapture(str(path))
        if not self._capture.isOpened():
            raise OSError(f"{path} is not a video that can be read")

    @override
    def read(self) -> NDArray[Any]:
        is_read, image = self._capture.read()
        if not is_read:
            self._capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            is_read, image = self._capture.read()
        if not is_read:
            raise OSError(f"{self._path} has no images")
        return image


class Pictures(FrameSource):
    """A picture, or all of a folder in the order of their names, in a loop.

    OSError: the folder has no picture, or one cannot be read.
    """

    def __init__(self, path: Path):
        paths = sorted(path.iterdir()) if path.is_dir() else [path]
        images = [load_picture(str(each)) for each in paths if each.suffix.lower() in SUFFIXES]
        if not images:
            raise OSError(f"no pictures ({', '.join(SUFFIXES)}) in {path}")
        self._images = itertools.cycle(images)

    @override
    def read(self) -> NDArray[Any]:
        return next(self._images)


def open_source(device: str, width: int, height: int, rate: float) -> FrameSource:
    """Return a `Webcam`, or the source of images at a path; OSError if it has no images."""
    if device.isdecimal() or device.startswith("/dev/"):
        return Webcam(device, width, height, rate)
    path = Path(device)
    if path.is_dir() or path.suffix.lower() in SUFFIXES:
        return Pictures(path)
    if path.is_file():
        return Video(path)
    raise OSError(f"{device!r} is not a camera, video, picture or folder")
