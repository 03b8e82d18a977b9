"""Draws the picture of the README: RViz on a virtual display, during a hover."""

import argparse
import contextlib
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
import rospkg
import yaml
from matplotlib import image
from numpy.typing import ArrayLike, NDArray
from PIL import ImageGrab

from crazyflie_description.visualizer_node import PATH_COLOUR, REFERENCE_COLOUR
from crazyflie_dev.demo import HOVER
from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_reports.flight_record import HOVER_TOLERANCE
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import LaunchError, roslaunch
from crazyflie_utils.testing.programs import running

#: Width and height in pixels of the screen, and of RViz's window in its configuration.
SCREEN = (1400, 900)
#: Path of the picture in the README.
PICTURE = Path(__file__).resolve().parents[5] / "docs" / "images" / "sw_hover.png"

_DRAW_LIMIT = 90.0
_FEWEST_PIXELS = 60
_SMALLEST_SHARE = 0.5
_LOG_LINES = 40


class DisplayError(Exception):
    """There is no display, or no picture; the text says why."""


@contextlib.contextmanager
def virtual_display(width: int, height: int) -> Iterator[str]:
    """Run Xvfb with a size in pixels on a display that is free; yield the display's name.

    `DisplayError`: Xvfb is not installed or does not start.
    """
    if shutil.which("Xvfb") is None:
        raise DisplayError("Xvfb is not installed (Debian package xvfb)")
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", f"{width}x{height}x24"]
    command += ["-nocursor", "-nolisten", "tcp"]
    with running(*command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        # Xvfb writes the number of its display when it is ready.
        with server.stdout as output:
            number = output.readline().strip()
        if not number:
            raise DisplayError("Xvfb ended at once; what it printed says why")
        yield f":{number}"


def screenshot(display: str) -> NDArray[np.uint8]:
    """Return what is on a display, such as ":7", now: shape (height, width, 3), uint8.

    `DisplayError`: the display cannot be reached.
    """
    try:
        return np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))
    except OSError as error:
        raise DisplayError(f"no picture of display {display}: {error}") from None


def pixels_of(picture: NDArray[np.uint8], colour: ArrayLike) -> int:
    """Return the number of pixels of a colour, in light or in shadow.

    The picture has the shape (height, width, 3); the colour is red, green, blue of any scale.
    """
    pixels = picture.reshape(-1, 3).astype(float)
    brightness = np.linalg.norm(pixels, axis=1)
    colour = np.asarray(colour, dtype=float) / np.linalg.norm(colour)
    return int(np.count_nonzero((brightness > 60.0) & (pixels @ colour > 0.99 * brightness)))


def crop_to_scene(screen: NDArray[np.uint8], background: ArrayLike) -> NDArray[np.uint8]:
    """Return a screen without RViz's panels: the part that has the background colour, 0 to 255.

    Arrays have the shape (height, width, 3); the result is empty when the colour is nowhere.
    """
    is_background = (screen == np.asarray(background)).all(axis=2)
    rows = np.flatnonzero(is_background.any(axis=1))
    columns = np.flatnonzero(is_background.any(axis=0))
    if not rows.size:
        return screen[:0, :0]
    return screen[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]


def background_of(configuration: Path) -> list[int]:
    """Return the background colour of an RViz configuration, three numbers from 0 to 255."""
    manager = yaml.safe_load(configuration.read_text())["Visualization Manager"]
    return [int(part) for part in manager["Global Options"]["Background Color"].split(";")]


def material_of(model: Path, name: str) -> list[float]:
    """Return the colour of a URDF's material, three numbers from 0 to 1."""
    colour = ElementTree.parse(model).find(f"material[@name='{name}']/color")
    if colour is None:
        raise ValueError(f"there is no material {name} in {model}")
    return [float(part) for part in colour.attrib["rgba"].split()[:3]]


show_progress = partial(print, flush=True)


def wait_for_picture(
    display: str, background: ArrayLike, colours: Mapping[str, ArrayLike]
) -> NDArray[np.uint8]:
    """Return RViz's picture on a display when colours, by the name of what has them, are on it.

    It has the shape (height, width, 3). `DisplayError`: something is missing.
    """
    deadline = time.monotonic() + _DRAW_LIMIT
    while True:
        screen = screenshot(display)
        picture = crop_to_scene(screen, background)
        missing = [name for name, c in colours.items() if pixels_of(picture, c) < _FEWEST_PIXELS]
        if picture.size < _SMALLEST_SHARE * screen.size:
            missing.insert(0, "window")
        if not missing:
            return picture
        if time.monotonic() > deadline:
            raise DisplayError(
                f"RViz has drawn no {' and no '.join(missing)} within {_DRAW_LIMIT:g} s"
            )
        time.sleep(0.5)


def render(output: Path, log: Path, launch_arguments: list[str]) -> None:
    """Fly to the hover; write what RViz shows into a PNG file, the output of roslaunch into a log.

    `DisplayError`: RViz has not drawn what it should; `FlightError`: the vehicle does not hover.
    """
    description = Path(rospkg.RosPack().get_path("crazyflie_description"))
    background = background_of(description / "launch" / "crazyflie.rviz")
    vehicle: dict[str, ArrayLike] = {
        "vehicle": material_of(description / "urdf" / "crazyflie2.urdf", "front")
    }
    markers = {"path": PATH_COLOUR, "reference": REFERENCE_COLOUR}
    colours = {name: (colour.r, colour.g, colour.b) for name, colour in markers.items()}
    with virtual_display(*SCREEN) as display:
        os.environ.update(DISPLAY=display, LIBGL_ALWAYS_SOFTWARE="1")
        arguments = ["crazyflie_examples", "sw_hover.launch", "rviz:=true", *launch_arguments]
        show_progress(f"launching {' '.join(arguments)} on display {display}")
        with roslaunch(arguments, log):
            operator = FlightOperator(begin("render_rviz"))
            operator.wait_until_ready()
            show_progress("waiting for RViz to draw the vehicle")
            wait_for_picture(display, background, vehicle)
            show_progress("taking off")
            operator.takeoff()
            operator.hover(1.0)
            error = math.dist(operator.position, HOVER)
            if error > HOVER_TOLERANCE:
                raise FlightError(f"it hovers {error:.3f} m from where it should")
            show_progress("waiting for RViz to draw vehicle, path and reference")
            picture = wait_for_picture(display, background, vehicle | colours)
    output.parent.mkdir(parents=True, exist_ok=True)
    image.imsave(output, np.ascontiguousarray(picture))
    show_progress(f"{output}: {picture.shape[1]} x {picture.shape[0]} pixels")


def main() -> int:
    """Render as the command line asks; return the exit status."""
    parser = argparse.ArgumentParser(prog="run render", description=__doc__)
    parser.add_argument(
        "--output", type=Path, default=PICTURE, help=f"PNG file, by default {PICTURE}"
    )
    parser.add_argument("launch_arguments", nargs="*", help="such as composed:=true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="render-") as folder:
        log = Path(folder) / "sw_hover.log"
        try:
            render(options.output, log, options.launch_arguments)
        except (DisplayError, FlightError, LaunchError) as error:
            if log.exists():
                print(*log.read_text().splitlines()[-_LOG_LINES:], sep="\n", file=sys.stderr)
            print(f"no picture: {error}", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
