"""A camera without distortion: its parameters, its projection, and its noise.

Pixels are counted from the middle of the one at the upper left, x to the right and y down. The
optical frame of a camera looks along z, with x to the right and y down (REP 103).
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import DURATION, METRES, Integer, Number

#: Rotation from the optical frame of a camera that looks ahead to forward, left, up.
OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


class MountParameters(Parameters):
    """The place of a camera on a vehicle."""

    x: float = parameter(METRES, "position ahead of the vehicle's centre", 0.03)
    y: float = parameter(METRES, "position to the left of the centre", 0.0)
    z: float = parameter(METRES, "above it", 0.01)
    pitch: float = parameter(
        Number("deg", minimum=-90.0, maximum=90.0), "angle by which the camera looks down", 0.0
    )
    yaw: float = parameter(
        Number("deg", minimum=-180.0, maximum=180.0),
        "angle by which the camera looks to the left",
        0.0,
    )


class CameraParameters(Parameters):
    """Parameters of a camera, from its YAML file."""

    width: int = parameter(Integer(16, 4096), "columns of the image", 320)
    height: int = parameter(Integer(16, 4096), "rows of the image", 240)
    fov: float = parameter(
        Number("deg", minimum=10.0, maximum=150.0),
        "angle between the left and the right edge",
        75.0,
    )
    rate: float = parameter(Number("Hz", above=0.0, maximum=200.0), "rate of images", 30.0)
    noise: float = parameter(
        Number(minimum=0.0, maximum=100.0),
        "standard deviation of each of a pixel's values, which are from 0 to 255",
        2.0,
    )
    latency: float = parameter(DURATION, "time from the exposure to the message", 0.03)
    mount: MountParameters = group(MountParameters, "mount")


def load(path: str | Path) -> CameraParameters:
    """Return the parameters in a camera's YAML file.

    `ParameterError` names all errors: file, line and what was expected.
    """
    return yaml_file.load(path).read(CameraParameters)


@dataclass(frozen=True)
class Pinhole:
    """The projection x = f X / Z + cx, y = f Y / Z + cy of the optical frame's X, Y, Z."""

    #: width, height: Size of the image (pixels).
    width: int
    height: int
    focal_length: float  #: f, pixels.

    @classmethod
    def with_fov(cls, width: int, height: int, fov: float) -> "Pinhole":
        """Return the camera whose image has the horizontal field of view ``fov`` (deg)."""
        return cls(width, height, 0.5 * width / math.tan(math.radians(fov) / 2.0))

    @property
    def centre(self) -> tuple[float, float]:
        """Place of the optical axis in the image: cx, cy."""
        return (self.width - 1) / 2.0, (self.height - 1) / 2.0

    @property
    def matrix(self) -> NDArray[np.float64]:
        """K of sensor_msgs/CameraInfo, shape (3, 3)."""
        f, (cx, cy) = self.focal_length, self.centre
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Pose:
    """Rotation and position of a frame: R and p of x' = R x + p."""

    rotation: NDArray[np.float64]  #: Shape (3, 3).
    position: NDArray[np.float64]  #: Shape (3,); m.

    def __matmul__(self, inner: "Pose") -> "Pose":
        """Return the pose of a frame that has the pose ``inner`` in this one."""
        return Pose(self.rotation @ inner.rotation, self.rotation @ inner.position + self.position)


def optical_pose(mount: MountParameters) -> Pose:
    """Return the pose of a mounted camera's optical frame in the vehicle's frame."""
    turned = Rotation.from_euler("ZY", [mount.yaw, mount.pitch], degrees=True).as_matrix()
    return Pose(turned @ OPTICAL, np.array([mount.x, mount.y, mount.z]))


_MARGIN = 64


class PixelNoise:
    """Normally distributed noise, the same for every pixel and colour.

    The noise is drawn once, on a larger image, of which every image (width, height in pixels) gets
    another part: random numbers for every pixel of every image would take longer than rendering the
    image. ``deviation`` is the standard deviation of a value from 0 to 255.
    """

    def __init__(self, width: int, height: int, deviation: float, seed: int = 0):
        self._random = np.random.default_rng(seed)
        shape = (height + _MARGIN, width + _MARGIN, 3)
        self._noise = np.round(self._random.normal(0.0, deviation, shape)).astype(np.int16)

    def add(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return an image with noise."""
        height, width = image.shape[:2]
        y, x = self._random.integers(_MARGIN, size=2)
        part = self._noise[y : y + height, x : x + width]
        return cv2.add(image, part, dtype=cv2.CV_8U)
