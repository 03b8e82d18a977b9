"""An X display without a screen, and what is drawn on it."""

import contextlib
import os
import select
import subprocess
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import ImageGrab

_START_LIMIT = 30.0
_END_LIMIT = 30.0


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
    number, writable = os.pipe()
    command = ["Xvfb", "-displayfd", str(writable), "-screen", "0", f"{width}x{height}x24"]
    command += ["-nocursor", "-nolisten", "tcp"]
    try:
        server = subprocess.Popen(command, pass_fds=[writable], start_new_session=True)
    except FileNotFoundError:
        os.close(number)
        raise DisplayError("Xvfb is not installed (Debian package xvfb)") from None
    finally:
        os.close(writable)
    try:
        yield f":{_read_line(number)}"
    finally:
        os.close(number)
        _end(server)


def _read_line(descriptor):
    text = b""
    deadline = time.monotonic() + _START_LIMIT
    while not text.endswith(b"\n"):
        wait = max(0.0, deadline - time.monotonic())
        if not select.select([descriptor], [], [], wait)[0]:
            raise DisplayError(f"Xvfb has not started within {_START_LIMIT:g} s")
        part = os.read(descriptor, 16)
        if not part:
            raise DisplayError("Xvfb ended at once; what it printed says why")
        text += part
    return text.decode().strip()


def _end(server):
    server.terminate()
    try:
        server.wait(_END_LIMIT)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
