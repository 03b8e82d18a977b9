#!/usr/bin/env python3
"""Draw the pictures of the page: a flight of three simulated vehicles, still and moving.

Usage: screenshot.py [FOLDER]
"""

import io
import itertools
import socket
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

from crazyflie_utils.testing.launching import roslaunch
from crazyflie_utils.testing.programs import free_port, running

HERE = Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1] / "test"))

from pages import Browser, chromium, wait_for  # noqa: E402  Helpers of the tests.

IMAGES = HERE.parents[4] / "docs" / "images"
FRAME = (720, 449)  #: Width of the moving picture (pixels).
PERIOD = 0.4  #: Period of frames (s).


class Film:
    """Frames of the window that a driver shows, at most one each `PERIOD`."""

    def __init__(self, driver) -> None:
        self._driver = driver
        self._frames: list[Image.Image] = []
        self._times: list[float] = []

    def take(self) -> bool:
        """Take a frame if one is due; return False, like a condition that does not hold."""
        if not self._times or time.monotonic() - self._times[-1] >= PERIOD:
            self._times.append(time.monotonic())
            screen = Image.open(io.BytesIO(self._driver.get_screenshot_as_png()))
            self._frames.append(screen.convert("RGB").resize(FRAME, Image.Resampling.LANCZOS))
        return False

    def until(self, condition, what: str) -> None:
        """Take frames until a condition holds."""
        wait_for(lambda: condition() or self.take(), what)

    def save(self, file: Path) -> None:
        """Write the frames as a GIF that repeats, with the colours of three of them."""
        some = [self._frames[len(self._frames) * part // 4] for part in (0, 2, 3)]
        sheet = Image.new("RGB", (FRAME[0], 3 * FRAME[1]))
        for row, frame in enumerate(some):
            sheet.paste(frame, (0, row * FRAME[1]))
        palette = sheet.quantize(128, kmeans=3)
        frames = [f.quantize(palette=palette, dither=Image.Dither.NONE) for f in self._frames]
        moments = [*self._times, self._times[-1] + 2.5]
        lengths = [round(1000 * (b - a)) for a, b in itertools.pairwise(moments)]
        frames[0].save(
            file, save_all=True, append_images=frames[1:], duration=lengths, loop=0, optimize=True
        )


def draw(port: int, folder: Path) -> None:
    """Fly from the page on a port, and write pictures of the page."""
    with chromium() as driver:
        driver.set_window_size(1440, 1040)
        browser = Browser(driver, f"http://127.0.0.1:{port}/")
        wait_for(lambda: browser.open() or True, "the page")
        browser.has("3 vehicles")
        film = Film(driver)
        film.take()
        browser.take_control()
        browser.press("All")
        film.take()
        browser.press("Take off")
        film.until(lambda: "3 in flight" in browser.text(), "three in flight")
        card = browser.card("cf3")
        film.until(lambda: "taking off" not in browser.text(card), "cf3 at its height")
        browser.press("None")
        browser.choose("cf3")
        browser.click_floor(0.9, -1.0)
        film.take()
        browser.press("Go")
        # Long enough for a visible trail; there is no condition to wait for.
        begin = time.monotonic()
        film.until(lambda: time.monotonic() - begin > 2.0, "a trail")
        driver.save_screenshot(str(folder / "dashboard.png"))
        film.until(lambda: time.monotonic() - begin > 5.0, "cf3 at its goal")
        browser.press("All")
        browser.press("Land")
        film.until(lambda: "0 in flight" in browser.text(), "all on the ground")
        film.save(folder / "dashboard.gif")


def main() -> None:
    """Launch the example with the page, draw, and end it."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    port = free_port(socket.SOCK_STREAM)
    swarm = ["crazyflie_examples", "sw_swarm.launch", "n:=3", "rviz:=false"]
    page = ("roslaunch", "crazyflie_dashboard", "dashboard.launch", f"port:={port}")
    with (
        tempfile.TemporaryDirectory() as logs,
        roslaunch(swarm, Path(logs) / "swarm.log"),
        running(*page),
    ):
        draw(port, folder)


if __name__ == "__main__":
    main()
