"""The choices of one page: a vehicle, fields of topics, a camera."""

from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Executor
from functools import partial
from typing import Any

import roslib.message

from crazyflie_dashboard import images
from crazyflie_dashboard.page_data import Series
from crazyflie_dashboard.plots import Ring, fields_of, number_in
from crazyflie_utils import NodeHandle
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.steps import follow

IMAGES = ("sensor_msgs/Image", "sensor_msgs/CompressedImage")  #: Types of the topics of cameras.
_IMAGE_PERIOD = 0.2  #: Shortest period of pictures of a camera (s).

_MAX_FIELDS = 20


class PageState:
    """The vehicle, the fields and the camera that a page shows in addition to the scene."""

    def __init__(self, handle: NodeHandle, workers: Executor, clock: Callable[[], float]) -> None:
        self.vehicles: tuple[str, ...] = ()  #: The vehicles whose plots the page shows.
        #: The camera's newest picture, or the reason why it cannot be shown.
        self.image: bytes | str | None = None
        self._handle, self._workers, self._clock = handle, workers, clock
        self._fields: dict[str, tuple[NodeHandle, Ring]] = {}
        self._camera: NodeHandle | None = None
        self._image_at = 0.0
        self._is_encoding = False
        self._waiting: Any = None  # The newest message that came during a conversion.

    def series(self, now: float) -> tuple[Series, ...]:
        """Return the plots of fields until ``now`` (s)."""
        return tuple(ring.series(path, now) for path, (_, ring) in list(self._fields.items()))

    def receive(self, paths: Collection[str], topics: Mapping[str, str]) -> None:
        """Receive numbers of the topics (topic -> type), each as in /topic/field/field.

        One whose topic is not there is not received until this is called again.
        """
        for path in self._fields.keys() - {*paths}:
            handle, _ = self._fields.pop(path)
            handle.close()
        for topic, kind in topics.items():
            for path in [each for each in paths if each.startswith(f"{topic}/")]:
                field = path.removeprefix(f"{topic}/")
                is_new = path not in self._fields and len(self._fields) < _MAX_FIELDS
                if is_new and field in fields_of(kind):
                    self._fields[path] = self._subscribe(topic, kind, field)

    def _subscribe(self, topic, kind, field):
        handle, ring = self._handle.child(), Ring("")
        message_type = roslib.message.get_message_class(kind)
        take = partial(number_in, field=field)
        handle.subscribe(topic, message_type, lambda m: ring.add(self._clock(), take(m)))
        return handle, ring

    def watch_image(self, topic: str | None, topics: Mapping[str, str]) -> None:
        """Show a camera, or none; `RefusalError` if the topic is not a camera."""
        if self._camera is not None:
            self._camera.close()
        self._camera = self._waiting = self.image = None
        if topic is None:
            return
        kind = topics.get(topic)
        if kind not in IMAGES:
            expected = " or ".join(IMAGES)
            raise RefusalError(f"{topic} is {kind or 'not published'}; expected {expected}")
        self._camera = self._handle.child()
        self._camera.subscribe(topic, roslib.message.get_message_class(kind), self._on_image)

    def close(self) -> None:
        """End all subscriptions."""
        self.watch_image(None, {})
        self.receive((), {})

    def _on_image(self, message):
        if self._is_encoding:
            self._waiting = message
        elif self._clock() - self._image_at >= _IMAGE_PERIOD:
            follow(self._encode(message), self._handle.submit)

    def _encode(self, message):
        self._is_encoding = True
        while message is not None:
            self._image_at, camera = self._clock(), self._camera
            try:
                # In another thread: a large picture takes tens of milliseconds.
                image = yield self._workers.submit(images.encoded, message)
            except Exception as error:
                image = str(error)
            if camera is self._camera is not None:
                self.image = image
            message, self._waiting = self._waiting, None
        self._is_encoding = False
