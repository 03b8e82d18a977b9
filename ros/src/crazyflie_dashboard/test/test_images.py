"""Pictures of cameras: sizes, types, and those that come while one is encoded."""

from concurrent.futures import Future

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import Image

from crazyflie_dashboard.images import encoded
from crazyflie_dashboard.page_state import PageState
from crazyflie_utils.testing.fake_process import FakeProcess

TOPIC = "/cf1/image"


def message(pixels, encoding, padding=0):
    """Return a picture; ``padding`` bytes follow each row."""
    rows = pixels.reshape(len(pixels), -1).view(np.uint8)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    return Image(
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=pixels.dtype.byteorder == ">",
        step=rows.shape[1],
        data=rows.tobytes(),
    )


def decoded(picture):
    return cv2.imdecode(np.frombuffer(encoded(picture), np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.parametrize(
    ("encoding", "kind"),
    [
        *(("mono8", np.uint8), ("8UC1", np.uint8), ("mono16", np.uint16), ("16UC1", ">u2")),
        *(("32FC1", np.float32), ("32FC1", ">f4")),
    ],
)
@pytest.mark.parametrize("width", [64, 1280])
def test_one_channel_of_any_size_is_the_picture_that_it_was(encoding, kind, width):
    # Dark at the left, bright at the right.
    pixels = np.tile(np.linspace(0, 255, width), (width // 2, 1)).astype(kind)
    shown = decoded(message(pixels, encoding, padding=4))
    assert shown.shape == (min(width, 640) // 2, min(width, 640), 3)
    assert shown[10, 2, 0] < 20
    assert shown[10, -2, 0] > 235


@pytest.mark.parametrize(
    ("encoding", "order"),
    [
        *(("rgb8", [2, 1, 0]), ("rgba8", [2, 1, 0, 3])),
        *(("bgr8", [0, 1, 2]), ("bgra8", [0, 1, 2, 3]), ("8UC3", [0, 1, 2])),
    ],
)
def test_colors_are_in_their_order(encoding, order):
    blue, green, red = 200, 100, 20
    pixels = np.zeros((32, 1000, len(order)), np.uint8)
    pixels[:] = np.array([blue, green, red, 255])[order]
    assert decoded(message(pixels, encoding))[5, 5] == pytest.approx((blue, green, red), abs=4)


def test_what_cannot_be_shown_is_reported():
    with pytest.raises(ValueError, match="encoding is yuv422; expected one of bgr8, "):
        encoded(message(np.zeros((4, 4), np.uint8), "yuv422"))
    short = message(np.zeros((4, 4), np.uint8), "mono8")
    short.data = short.data[:-1]
    with pytest.raises(ValueError, match="15 bytes for 4 rows of 4; expected 16"):
        encoded(short)
    with pytest.raises(ValueError, match="4 x 70000 pixels cannot be encoded as JPEG"):
        encoded(message(np.zeros((70000, 4), np.uint8), "mono8"))


class Later:
    """Does its work when it is told."""

    def __init__(self):
        self.work = []

    def submit(self, *work):
        self.work.append((work, Future()))
        return self.work[-1][1]

    def do(self):
        (work, *arguments), done = self.work.pop(0)
        done.set_result(work(*arguments))


def test_pictures_are_encoded_elsewhere_and_only_the_newest_is():
    process, workers = FakeProcess(), Later()
    page = PageState(process.handle("/dashboard"), workers, process.clock.time)
    page.watch_image(TOPIC, {TOPIC: Image._type})
    pictures = [message(np.full((8, 8), 40 * k, np.uint8), "mono8") for k in range(5)]
    for picture in pictures:
        process.advance(0.3)
        process.publish(TOPIC, picture)
    assert (page.image, len(workers.work)) == (None, 1)
    while workers.work:
        workers.do()
    assert page.image == encoded(pictures[-1])
