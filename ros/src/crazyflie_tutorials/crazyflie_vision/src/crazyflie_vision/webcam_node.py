"""ROS interface of a webcam, or of a file in its place."""

import threading

import cv2
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, ParameterError, Parameters, parameter, topic
from crazyflie_utils.parameters.types import FRAME, TEXT, Integer, Number
from crazyflie_vision.camera import Pinhole
from crazyflie_vision.frame_source import FrameSource, open_source
from crazyflie_vision.images import camera_info, to_message

_PIXELS = Integer(16, 4096, "pixels")


class WebcamParameters(Parameters):
    """Parameters of `WebcamNode`."""

    device: str = parameter(
        TEXT, "path or number of a camera; or path of a video, picture or folder", "/dev/video0"
    )
    width: int = parameter(_PIXELS, "of the images", 320)
    height: int = parameter(_PIXELS, "of the images", 240)
    rate: float = parameter(Number("Hz", above=0.0, maximum=200.0), "rate of images", 30.0)
    fov: float = parameter(
        Number("deg", minimum=10.0, maximum=150.0),
        "angle between the left and the right edge",
        60.0,
    )
    frame: str = parameter(FRAME, "the camera's optical frame", "camera", name="frames/camera")
    image_topic: str = topic("image", "images", "camera/image_raw")
    info_topic: str = topic(
        "info", "parameters of the camera, with each image", "camera/camera_info"
    )


class WebcamNode(Node[WebcamParameters]):
    """Publish the images of a webcam; end when it is disconnected."""

    sources = "a camera"

    needed_in_flight = True

    def __init__(self) -> None:
        self._is_over = threading.Event()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        each = self._parameters
        self._pinhole = Pinhole.with_fov(each.width, each.height, each.fov)
        try:
            self._source: FrameSource = open_source(each.device, each.width, each.height, each.rate)
        except OSError as error:
            raise ParameterError(f"parameter {handle.resolve('~device')}: {error}") from None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._images = handle.publisher(parameters.image_topic, Image)
        self._infos = handle.publisher(parameters.info_topic, CameraInfo)
        if self._source.is_live:
            # The thread waits for images, which a callback must not do.
            threading.Thread(target=self._watch, daemon=True).start()
        else:
            handle.timer(1.0 / parameters.rate, self._read)

    @override
    def shutdown(self) -> None:
        """End the thread; the camera ends with the process."""
        self._is_over.set()

    def _watch(self):
        while not self._is_over.is_set() and self._read():
            pass

    def _read(self):
        """Read an image and have it published; return whether there was one."""
        try:
            self._handle.submit(self._publish, self._source.read())
        except OSError as error:
            self._handle.submit(self._end, str(error))
            return False
        return True

    def _publish(self, image):
        size = (self._pinhole.width, self._pinhole.height)
        if image.shape[1::-1] != size:
            image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        header = Header(stamp=self._handle.stamp(), frame_id=self._parameters.frame)
        self._infos.publish(camera_info(self._pinhole, header))
        self._images.publish(to_message(image, header))

    def _end(self, reason):
        if not self._is_over.is_set():
            self._handle.error(reason)
            self._handle.end(1)
