"""An X display without a screen, and what is drawn on it."""

import contextlib
import select
import subprocess
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import ImageGrab

from crazyflie_utils.testing.programs import running

_START_LIMIT = 30.0  #: Longest time until Xvfb is ready (s).


class DisplayError(Exception):
    """There is no display, or no picture; the text says why."""


def screenshot(display: str) -> NDArray[np.uint8]:
    """Return what is on a display, such as ":7", now: shape (height, width, 3), uint8.

    `DisplayError`: the display cannot be reached.
    """
    try:
        return np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))
    except OSError as error:
        raise DisplayError(f"no picture of display {display}: {error}") from None


@contextlib.contextmanager
def virtual_display(width: int, height: int) -> Iterator[str]:
    """Run Xvfb with a size in pixels on a display that is free; yield the display's name.

    `DisplayError`: Xvfb is not installed or does not start.
    """
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", f"{width}x{height}x24"]
    command += ["-nocursor", "-nolisten", "tcp"]
    with contextlib.ExitStack() as stack:
        try:
            server = stack.enter_context(running(*command, stdout=subprocess.PIPE, text=True))
        except FileNotFoundError:
            raise DisplayError("Xvfb is not installed (Debian package xvfb)") from None
        assert server.stdout is not None
        # Xvfb writes the number of its display when it is ready.
        output = stack.enter_context(server.stdout)
        if not select.select([output], [], [], _START_LIMIT)[0]:
            raise DisplayError(f"Xvfb has not started within {_START_LIMIT:g} s")
        number = output.readline().strip()
        if not number:
            raise DisplayError("Xvfb ended at once; what it printed says why")
        yield f":{number}"
