"""An X display without a screen, and what is drawn on it."""

import contextlib
import os
import select
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

_START_LIMIT = 10.0
_END_LIMIT = 5.0


class DisplayError(Exception):
    """There is no display, or no picture; the text says why."""


def decode_xwd(dump: bytes) -> np.ndarray:
    """Return the picture in an X window dump of 32 bits a pixel.

    Parameters
    ----------
    dump : bytes
        File format of xwd, version 7, as X11/XWDFile.h defines it: a header of
        big-endian 32-bit words, colour map entries of 12 bytes, rows of pixels.

    Returns
    -------
    ndarray, shape (height, width, 3)
        Red, green and blue, uint8.

    Raises
    ------
    DisplayError
        It is no such dump, or not complete.
    """
    if len(dump) < 100:
        raise DisplayError(f"a window dump of {len(dump)} bytes has no header")
    header = np.frombuffer(dump, ">u4", count=25).astype(int)
    header_size, version = header[0:2]
    width, height = header[4:6]
    byte_order, bits, row_size, colours = header[7], header[11], header[12], header[19]
    if version != 7 or bits != 32:
        raise DisplayError(
            f"a window dump of version {version} with {bits} bits a pixel; expected 7 and 32"
        )
    start = header_size + 12 * colours
    if len(dump) < start + height * row_size:
        raise DisplayError(f"a window dump of {width} x {height} pixels is cut off")
    rows = np.frombuffer(dump, np.uint8, count=height * row_size, offset=start)
    pixels = rows.reshape(height, row_size)[:, : 4 * width].reshape(height, width, 4)
    return pixels[:, :, 2::-1] if byte_order == 0 else pixels[:, :, 1:]


class VirtualDisplay:
    """A running display.

    Attributes
    ----------
    name : str
        For the environment variable DISPLAY.
    """

    def __init__(self, name: str, folder: Path):
        self.name = name
        self._folder = folder

    def picture(self) -> np.ndarray:
        """Return what is on the screen now, shape (height, width, 3), uint8."""
        return decode_xwd((self._folder / "Xvfb_screen0").read_bytes())


@contextlib.contextmanager
def virtual_display(width: int, height: int) -> Iterator[VirtualDisplay]:
    """Run Xvfb on a display that is free, for the time of a with block.

    The screen is a file that is read, so that no X client is needed to see it.

    Parameters
    ----------
    width, height : int
        Pixels.

    Raises
    ------
    DisplayError
        Xvfb is not installed or does not start.
    """
    with tempfile.TemporaryDirectory(prefix="display-") as folder:
        number, told = os.pipe()
        command = ["Xvfb", "-displayfd", str(told), "-screen", "0", f"{width}x{height}x24"]
        command += ["-fbdir", folder, "-nocursor", "-nolisten", "tcp"]
        try:
            server = subprocess.Popen(command, pass_fds=[told], start_new_session=True)
        except FileNotFoundError:
            os.close(number)
            raise DisplayError("Xvfb is not installed (Debian package xvfb)") from None
        finally:
            os.close(told)
        try:
            yield VirtualDisplay(f":{_read_line(number)}", Path(folder))
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
