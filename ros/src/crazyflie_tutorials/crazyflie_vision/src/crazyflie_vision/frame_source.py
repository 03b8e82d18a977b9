"""Sources of images that are not simulated: a webcam, a video, a folder of pictures."""

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
from numpy.typing import NDArray

from crazyflie_utils.text_file import user_path
from crazyflie_vision.renderer import load_picture

SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png")  #: Suffixes of pictures in a folder.


class FrameSource(NamedTuple):
    """Images, one after the other."""

    #: ``read()`` returns the next image, shape (height, width, 3): blue, green, red. OSError: the
    #: source has ended.
    read: Callable[[], NDArray[Any]]
    is_live: bool = False  #: Whether images come at the source's own rate.


def webcam(device: str, width: int, height: int, rate: float) -> FrameSource:
    """Return a camera, by its number or path, such as "0" or "/dev/video0".

    Width, height (pixels) and rate (1/s) are requested; the camera may deliver others. OSError if
    it cannot be used; the text names the available cameras.
    """
    capture = cv2.VideoCapture(int(device) if device.isdecimal() else device)
    if not capture.isOpened():
        present = ", ".join(sorted(map(str, Path("/dev").glob("video*")))) or "none"
        raise OSError(f"the camera {device} does not exist, or is in use; available: {present}")
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    capture.set(cv2.CAP_PROP_FPS, rate)

    def read():
        is_read, image = capture.read()
        if not is_read:
            raise OSError(f"camera {device} gives no more images; was it unplugged?")
        return image

    return FrameSource(read, is_live=True)


def video(path: Path) -> FrameSource:
    """Return a video file, in a loop; OSError if OpenCV cannot read it."""
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise OSError(f"{path} is not a video that can be read")

    def read():
        is_read, image = capture.read()
        if not is_read:
            capture.set(cv2.CAP_PROP_POS_FRAMES, 0)
            is_read, image = capture.read()
        if not is_read:
            raise OSError(f"{path} has no images")
        return image

    return FrameSource(read)


def pictures(path: Path) -> FrameSource:
    """Return a picture, or all of a folder in the order of their names, in a loop.

    OSError: the folder has no picture, or one cannot be read.
    """
    paths = sorted(path.iterdir()) if path.is_dir() else [path]
    images = [load_picture(str(each)) for each in paths if each.suffix.lower() in SUFFIXES]
    if not images:
        raise OSError(f"no pictures ({', '.join(SUFFIXES)}) in {path}")
    return FrameSource(itertools.cycle(images).__next__)


def open_source(device: str, width: int, height: int, rate: float) -> FrameSource:
    """Return a `webcam`, or the source of images at a path; OSError if it has no images."""
    if device.isdecimal() or device.startswith("/dev/"):
        return webcam(device, width, height, rate)
    path = user_path(device).absolute()
    if path.is_dir() or path.suffix.lower() in SUFFIXES:
        return pictures(path)
    if path.is_file():
        return video(path)
    raise OSError(f"{device!r} is not a camera, video, picture or folder; looked for {path}")
