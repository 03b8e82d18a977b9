"""In the place of the motioncapture package: a system that does what its address says."""

import ctypes
import signal
from pathlib import Path
from types import SimpleNamespace

DONE = Path("done")
"""Appears in the working folder when a script is over."""

SCRIPTS = {
    # Positions of "cf1" and "still" in frames: x, or None if missing.
    "127.0.0.1": [(1.0, 5.0), (2.0, 5.0), (3.0, 6.0)],
    "127.0.0.2": [(1.0, 5.0), (1.0, 5.0), (1.0, 5.0)],
    "127.0.0.6": [(float(number), 5.0) for number in range(20000)],
    "127.0.0.7": [(1.0, 5.0), (1.0, 5.0), (2.0, 5.0)],
    "127.0.0.5": [(1.0, 5.0), (float("nan"), 6.0)],
}

REFUSING = "127.0.0.3"
HANGING = "127.0.0.4"
WITH_POINTS = "127.0.0.7"


def connect(system, config):
    """Return a connection, or none, or never."""
    host = config["hostname"]
    print("an unsolicited message", flush=True)
    if host == REFUSING:
        raise RuntimeError(f"{system} is not at home")
    if host == HANGING:
        hang()
    return (_ConnectionWithPoints if host == WITH_POINTS else _Connection)(SCRIPTS[host])


def hang():
    """Wait as the package does: in C, with the interpreter's lock; the time limit passes fast."""
    assert signal.getitimer(signal.ITIMER_REAL)[0] > 1.0
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    ctypes.PyDLL(None).sleep(60)


class _Connection:
    def __init__(self, script):
        self._script = list(script)
        self.rigidBodies = {}

    def waitForNextFrame(self):  # noqa: N802
        if not self._script:
            DONE.touch()
            hang()
        names = ("cf1", "still")
        self.rigidBodies = {
            name: SimpleNamespace(
                position=(x, 2.0, 3.0), rotation=SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
            )
            for name, x in zip(names, self._script.pop(0), strict=True)
        }


class _ConnectionWithPoints(_Connection):
    """A version that reports unlabelled markers, one of them next to cf1."""

    @property
    def pointCloud(self):  # noqa: N802
        return [[self.rigidBodies["cf1"].position[0], 0.5, 1.0]]
