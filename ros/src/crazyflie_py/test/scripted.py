"""Scripts on vehicles that run: what they print, and where the vehicles were."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import rospkg

EXAMPLES = Path(rospkg.RosPack().get_path("crazyflie_py")) / "examples"
LIMIT = 90.0
"""Of a script, s."""

TRACE = """
import json, runpy, sys
from crazyflie_py.ros_swarm import RosSwarm

track = []
sleep = RosSwarm.sleep


def traced(self, duration):
    sleep(self, duration)
    fleet = self._connection.fleet
    track.append([fleet.position(name) for name in fleet.names])


RosSwarm.sleep = traced
sys.argv = sys.argv[1:]
try:
    runpy.run_path(sys.argv[0], run_name="__main__")
finally:
    print("track", json.dumps(track))
"""


def run(script, *options, status=0):
    """Run a script to its end; return what it has printed."""
    command = [sys.executable, "-c", TRACE, str(script), *options]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=LIMIT, env=os.environ, check=False
    )
    assert done.returncode == status, done.stdout + done.stderr
    return done.stdout + done.stderr


def fly(name, *options):
    """Fly an example; return the positions after each sleep, shape (n, vehicles, 3), m."""
    lines = run(EXAMPLES / name, *options).splitlines()
    (track,) = [line.removeprefix("track ") for line in lines if line.startswith("track ")]
    return np.array(json.loads(track))
