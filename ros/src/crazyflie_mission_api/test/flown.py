"""Scripts that fly, and where vehicles were meanwhile."""

import contextlib
import math
import subprocess
import sys

import rospy

from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils.testing import peer

LIMIT = 120.0  #: How long a script may take, s.


@contextlib.contextmanager
def recorded(names):
    """Record where vehicles are: name -> list of positions, m."""
    tracks = {name: [] for name in names}

    def note(message, track):
        track.append((message.state.x, message.state.y, message.state.z))

    with contextlib.ExitStack() as stack:
        for name, track in tracks.items():
            state = PositionVelocityYawStateStamped
            subscriber = rospy.Subscriber(f"/{name}/state", state, note, track)
            stack.callback(subscriber.unregister)
        peer.wait_until(lambda: all(tracks.values()), "states")
        yield tracks


def script(path, *arguments, **options):
    """Start a script."""
    command = [sys.executable, path, *arguments]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, **options)


def run(path, *arguments, limit=LIMIT):
    """Run a script to its end; return its exit status and what it has complained of."""
    with script(path, *arguments) as process:
        try:
            _, errors = process.communicate(timeout=limit)
        except BaseException:
            process.kill()
            raise
    return process.returncode, errors


def nearest(track, point):
    """Return how near a vehicle has come to a point, m."""
    return min(math.dist(position, point) for position in track)
