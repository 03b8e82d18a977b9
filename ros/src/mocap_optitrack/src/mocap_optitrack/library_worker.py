"""A process of its own for the motioncapture package.

``python -m mocap_optitrack.library_worker TYPE HOST`` writes JSON to its standard
output, one value a line: first, when it is connected, whether the package tells unlabelled
markers (not all versions do), then for every frame [moment, bodies, points], where moment is
when the package returned it, s of time.monotonic(), bodies a list of [name, x, y, z, qx, qy, qz,
qw] and points one of [x, y, z]; m and z up, as the system has them. When the package fails it
writes {"error": text} and ends. Frames for which the pipe has no room are dropped: if the worker
waited for the reader, frames would age before they get their time.

Without a server the package may wait for ever, in C++ and with Python's interpreter
lock held. So only a signal that kills can limit it, and nothing else should run in this process.
"""

import contextlib
import json
import os
import signal
import sys
import time
from typing import Any

CONNECT_LIMIT = 10.0  #: Longest time for connecting (s).
FRAME_LIMIT = 5.0  #: Longest wait for a frame (s).


def main() -> int:
    """Run until the system or the reader ends; return the exit status."""
    system, host = sys.argv[1:]
    # The package's own messages must not come between the lines.
    lines = _Lines(os.dup(sys.stdout.fileno()))
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # Signals that Python handles wait for the lock; these kill, also in C++.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        _stream(system, host, lines)
    except BrokenPipeError:
        # The reader of the lines has ended.
        return 0
    except ImportError as error:
        text = "the motioncapture package (from PyPI; for x86-64 and Python up to 3.13) is missing"
        lines.write_last({"error": f"{text}: {error}"})
    except Exception as error:
        lines.write_last({"error": str(error)})
    return 1


class _Lines:
    # JSON values to a pipe; one that does not fit at once is completed before the next.
    def __init__(self, descriptor: int):
        self._descriptor = descriptor
        self._rest = b""
        os.set_blocking(descriptor, False)

    def write(self, value):
        self._flush()
        if not self._rest:
            self._rest = json.dumps(value).encode() + b"\n"
            self._flush()

    def write_last(self, value):
        os.set_blocking(self._descriptor, True)
        while self._rest:
            self._flush()
        self.write(value)

    def _flush(self):
        if self._rest:
            with contextlib.suppress(BlockingIOError):
                self._rest = self._rest[os.write(self._descriptor, self._rest) :]


def _stream(system, host, lines):
    signal.setitimer(signal.ITIMER_REAL, CONNECT_LIMIT)
    import motioncapture

    connection = motioncapture.connect(system, {"hostname": host})
    lines.write(hasattr(type(connection), "pointCloud"))
    while True:
        signal.setitimer(signal.ITIMER_REAL, FRAME_LIMIT)
        connection.waitForNextFrame()
        moment = time.monotonic()
        bodies = connection.rigidBodies.items()
        points = [[float(x) for x in point] for point in getattr(connection, "pointCloud", ())]
        lines.write([moment, [[name, *pose(body)] for name, body in bodies], points])


def pose(body: Any) -> list[float]:
    """Return position and quaternion (x, y, z, w) of one of the package's rigid bodies."""
    rotation = body.rotation
    quaternion = (rotation.x, rotation.y, rotation.z, rotation.w)
    return [float(part) for part in (*body.position, *quaternion)]


if __name__ == "__main__":
    sys.exit(main())
