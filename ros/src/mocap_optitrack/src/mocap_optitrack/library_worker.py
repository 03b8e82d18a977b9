"""A process of its own for the motioncapture package.

``python -m mocap_optitrack.library_worker TYPE HOST`` sends JSON over the socket that is its
standard output, one value a packet: first, when it is connected, whether the package tells
unlabelled markers (not all versions do), then for every frame [moment, bodies, points], where
moment is when the package returned it, s of time.monotonic(), bodies a list of [name, x, y, z, qx,
qy, qz, qw] and points one of [x, y, z]; m and z up, as the system has them. When the package fails
it sends {"error": text} and ends. Frames for which the socket has no room are dropped: if the
worker waited for the reader, frames would age before they get their time.

Without a server the package may wait for ever, in C++ and with Python's interpreter
lock held. So only a signal that kills can limit it, and nothing else should run in this process.
"""

import contextlib
import json
import os
import signal
import socket
import sys
import time
from typing import Any

CONNECT_LIMIT = 10.0  #: Longest time for connecting (s).
FRAME_LIMIT = 5.0  #: Longest wait for a frame (s).


def main() -> int:
    """Run until the system or the reader ends; return the exit status."""
    system, host = sys.argv[1:]
    # The package's own messages must not come between the packets.
    output = socket.socket(fileno=os.dup(sys.stdout.fileno()))
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # Signals that Python handles wait for the lock; these kill, also in C++.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        _stream(system, host, output)
    except ConnectionError:
        # The reader has ended.
        return 0
    except ImportError as error:
        text = "the motioncapture package (from PyPI; for x86-64 and Python up to 3.13) is missing"
        _send(output, {"error": f"{text}: {error}"})
    except Exception as error:
        _send(output, {"error": str(error)})
    return 1


def _send(output, value, flags=0):
    output.send(json.dumps(value).encode(), flags)


def _stream(system, host, output):
    signal.setitimer(signal.ITIMER_REAL, CONNECT_LIMIT)
    import motioncapture

    connection = motioncapture.connect(system, {"hostname": host})
    _send(output, hasattr(type(connection), "pointCloud"))
    while True:
        signal.setitimer(signal.ITIMER_REAL, FRAME_LIMIT)
        connection.waitForNextFrame()
        moment = time.monotonic()
        bodies = connection.rigidBodies.items()
        points = [[float(x) for x in point] for point in getattr(connection, "pointCloud", ())]
        with contextlib.suppress(BlockingIOError):
            poses = [[name, *pose(body)] for name, body in bodies]
            _send(output, [moment, poses, points], socket.MSG_DONTWAIT)


def pose(body: Any) -> list[float]:
    """Return position and quaternion (x, y, z, w) of one of the package's rigid bodies."""
    rotation = body.rotation
    quaternion = (rotation.x, rotation.y, rotation.z, rotation.w)
    return [float(part) for part in (*body.position, *quaternion)]


if __name__ == "__main__":
    sys.exit(main())
