"""Missions of simulated vehicles, as fast as it goes: the README's, and eight figures of eight."""

import contextlib
import math
import os
import re
import runpy
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rospkg
import rospy
from std_msgs.msg import String

from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_utils.testing import peer

PACKAGE = Path(rospkg.RosPack().get_path("crazyflie_mission_api"))
LIMIT = 100.0
"""How long a mission may take, s."""


@contextlib.contextmanager
def recorded(names):
    """Record where vehicles are: name -> list of positions."""
    tracks = {name: [] for name in names}

    def note(message, track):
        track.append((message.state.x, message.state.y, message.state.z))

    subscribers = [
        rospy.Subscriber(f"/{name}/state", PositionVelocityYawStateStamped, note, track)
        for name, track in tracks.items()
    ]
    peer.wait_until(lambda: all(tracks.values()), "states")
    try:
        yield tracks
    finally:
        for subscriber in subscribers:
            subscriber.unregister()


def run(script, *arguments):
    """Run a script to its end; it must succeed."""
    subprocess.run([sys.executable, script, *arguments], check=True, timeout=LIMIT)


def nearest(track, point):
    """Return how near a vehicle has come to a point, m."""
    return min(math.dist(position, point) for position in track)


def offset(track, dx, dy, z):
    """Return a point by where the vehicle stood, m."""
    x, y, _ = track[0]
    return (x + dx, y + dy, z)


def test_eight_figures_of_eight():
    names = [f"cf{k}" for k in range(1, 9)]
    with recorded(names) as tracks:
        run(PACKAGE / "examples" / "figure_eights.py", *names)
    for k, track in enumerate(tracks.values()):
        side = 1.0 if k % 2 == 0 else -1.0
        quarter = (0.75 * math.sin(math.pi / 4.0), side * 0.375, 1.0)
        assert nearest(track, offset(track, *quarter)) < 0.15
        assert np.ptp(np.array(track), axis=0) == pytest.approx([1.5, 0.75, 1.0], abs=0.2)
        assert track[-1] == pytest.approx(track[0], abs=0.1)


def test_the_script_of_the_readme(tmp_path):
    text = re.search(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.S).group(1)
    script = tmp_path / "mission.py"
    script.write_text(text.replace('["cf1", "cf2"]', '["cf1", "cf2"]'))
    with recorded(["cf1", "cf2"]) as tracks:
        run(script)
