"""What one page has chosen to see: a vehicle, fields of topics, a camera."""

from collections.abc import Callable, Mapping

import roslib.message

from crazyflie_dashboard import images
from crazyflie_dashboard.page_data import Series
from crazyflie_dashboard.plots import Ring, expect_field, number_in, split_path
from crazyflie_utils import NodeHandle
from crazyflie_utils.refusal import RefusalError

IMAGES = ("sensor_msgs/Image", "sensor_msgs/CompressedImage")  #: Types of the topics of cameras.
_IMAGE_PERIOD = 0.2  #: Between two pictures of a camera, s.

_MAX_FIELDS = 20


class PageState:
    """What a page sees beside the scene."""

    def __init__(self, handle: NodeHandle, clock: Callable[[], float]) -> None:
        self.vehicle: str | None = None  #: The one whose plots it shows.
        self.image: bytes | None = None  #: The camera's newest picture.
        self._handle, self._clock = handle, clock
        self._fields: dict[str, tuple[NodeHandle, Ring]] = {}
        self._camera: NodeHandle | None = None
        self._image_at = 0.0

    def series(self) -> tuple[Series, ...]:
        """Return the plots of fields."""
        now = self._clock()
        return tuple(ring.series(path, now) for path, (_, ring) in list(self._fields.items()))

    def add_field(self, path: str, topics: Mapping[str, str]) -> None:
        """Plot a number of one of the topics (topic -> type), or raise `RefusalError`."""
        if path in self._fields:
            return
        if len(self._fields) >= _MAX_FIELDS:
            raise RefusalError(f"{path}: there are {_MAX_FIELDS} plots; expected no more")
        topic, fields = split_path(path, topics)
        message_type = roslib.message.get_message_class(topics[topic])
        if message_type is None:
            raise RefusalError(f"{path}: {topics[topic]} is unknown here; source its workspace")
        # What cannot be a field of this type is refused now, and not when a message comes.
        expect_field(path, message_type, fields)
        handle, ring = self._handle.child(), Ring("")
        handle.subscribe(
            topic,
            message_type,
            lambda message: ring.add(self._clock(), number_in(message, fields)),
        )
        self._fields[path] = handle, ring

    def remove_field(self, path: str) -> None:
        """Plot it no longer."""
        if path in self._fields:
            handle, _ = self._fields.pop(path)
            handle.close()

    def watch_image(self, topic: str | None, topics: Mapping[str, str]) -> None:
        """Show a camera, or none; `RefusalError` for what is no camera."""
        if self._camera is not None:
            self._camera.close()
        self._camera, self.image = None, None
        if topic is None:
            return
        kind = topics.get(topic)
        if kind not in IMAGES:
            expected = " or ".join(IMAGES)
            raise RefusalError(f"{topic} is {kind or 'not published'}; expected {expected}")
        self._camera = self._handle.child()
        self._camera.subscribe(topic, roslib.message.get_message_class(kind), self._on_image)

    def close(self) -> None:
        """Receive nothing any more."""
        self.watch_image(None, {})
        for path in list(self._fields):
            self.remove_field(path)

    def _on_image(self, message):
        now = self._clock()
        if now - self._image_at >= _IMAGE_PERIOD:
            self.image, self._image_at = images.encoded(message), now
