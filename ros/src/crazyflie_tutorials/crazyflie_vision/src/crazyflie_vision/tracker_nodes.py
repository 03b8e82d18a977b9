"""Image in, target out: the ROS interfaces of the trackers."""

from typing import Any

from geometry_msgs.msg import Point, PointStamped
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from typing_extensions import TypeVar, override

from crazyflie_utils import NodeHandle, ParameterError, Parameters, parameter, topic
from crazyflie_utils.parameters.types import FILE, Integer, Number
from crazyflie_vision.images import ImageNode, to_message
from crazyflie_vision.trackers import CASCADE, ColourBounds, FaceDetector, Target, draw, find


class TrackerParameters(Parameters):
    """Parameters that all trackers have."""

    image_topic: str = topic("image", "input images", "camera/image_raw")
    target_topic: str = topic("target", "the target: x, y and, as z, radius in pixels", "target")
    debug_topic: str = topic("debug_image", "images with the target marked", "~image")


T = TypeVar("T", bound=TrackerParameters, default=Any)


class TrackerNode(ImageNode[T]):
    """Base class: a tracker has parameters, and `find`.

    A target is published with the stamp of its image; without a target, nothing is published.
    """

    needed_in_flight = True

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._target = handle.publisher(self._parameters.target_topic, PointStamped)
        self._debug = handle.publisher(self._parameters.debug_topic, Image)
        self.watch(handle, self._parameters.image_topic)

    def find(self, image: NDArray[Any]) -> Target | None:
        """Return the target, or None if it is not seen."""
        raise NotImplementedError

    @override
    def on_image(self, image: NDArray[Any], header: Header) -> None:
        target = self.find(image)
        if target is not None:
            point = Point(target.x, target.y, target.radius)
            self._target.publish(PointStamped(header, point))
        if self._debug.has_subscribers():
            self._debug.publish(to_message(draw(image, target), header))


class ColourTrackerParameters(ColourBounds, TrackerParameters):
    """Parameters of `ColourTrackerNode`."""

    smallest_area: float = parameter(
        Number("pixels", minimum=1.0), "area of the smallest target", 30.0, live=True
    )


class ColourTrackerNode(TrackerNode[ColourTrackerParameters]):
    """Publish the place of the largest object of a colour."""

    @override
    def find(self, image: NDArray[Any]) -> Target | None:
        return find(image, self._parameters, self._parameters.smallest_area)


class FaceDetectorParameters(TrackerParameters):
    """Parameters of `FaceDetectorNode`."""

    cascade: str = parameter(FILE, "file of the cascade", CASCADE)
    smallest: int = parameter(
        Integer(20, 1000, "pixels"), "width of the smallest face", 30, live=True
    )
    neighbours: int = parameter(
        Integer(1, 50),
        "number of overlapping finds that make a face; more of them give fewer errors",
        4,
        live=True,
    )


class FaceDetectorNode(TrackerNode[FaceDetectorParameters]):
    """Publish the place of the largest face."""

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        try:
            self._detector = FaceDetector(self._parameters.cascade)
        except OSError as error:
            raise ParameterError(f"parameter {handle.resolve('~cascade')}: {error}") from None

    @override
    def find(self, image: NDArray[Any]) -> Target | None:
        return self._detector.find(image, self._parameters.smallest, self._parameters.neighbours)
