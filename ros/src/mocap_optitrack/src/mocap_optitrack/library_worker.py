"""A process of its own for the motioncapture package.

``python -m mocap_optitrack.library_worker TYPE HOST`` writes JSON to its standard
output, one value a line: first null, when it is connected, then for every frame a
list of [name, x, y, z, qx, qy, qz, qw]; m and z up, as the system has them. When the
package fails it writes {"error": text} and ends.

Without a server the package may wait for ever, in C++ and with Python's interpreter
lock held. So nothing in this process can limit it but a signal that kills, and
nothing else should live in this process.
"""

import json
import os
import signal
import sys
from typing import Any

CONNECT_LIMIT = 10.0
"""How long connecting may take, s."""

FRAME_LIMIT = 5.0
"""How long a frame may take, s."""


def main() -> int:
    """Run until the system or the reader goes away; return the exit status."""
    system, host = sys.argv[1:]
    # The package's own messages must not come between the lines.
    out = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    # Signals that Python handles wait for the lock; these kill, also in C++.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        _stream(system, host, out)
    except BrokenPipeError:
        # Who reads the lines has ended.
        return 0
    except Exception as error:
        print(json.dumps({"error": str(error)}), file=out)
    return 1


def _stream(system, host, out):
    signal.setitimer(signal.ITIMER_REAL, CONNECT_LIMIT)
    import motioncapture

    connection = motioncapture.connect(system, {"hostname": host})
    print(json.dumps(None), file=out)
    while True:
        signal.setitimer(signal.ITIMER_REAL, FRAME_LIMIT)
        connection.waitForNextFrame()
        bodies = connection.rigidBodies.items()
        print(json.dumps([[name, *pose(body)] for name, body in bodies]), file=out)


def pose(body: Any) -> list[float]:
    """Return position and quaternion (x, y, z, w) of one of the package's rigid bodies."""
    rotation = body.rotation
    quaternion = (rotation.x, rotation.y, rotation.z, rotation.w)
    return [float(part) for part in (*body.position, *quaternion)]


if __name__ == "__main__":
    sys.exit(main())
