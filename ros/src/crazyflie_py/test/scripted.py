"""Scripts on vehicles that run: what they print, and where the vehicles were."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import rosnode
import rospkg

from crazyflie_utils.testing.programs import wait_until

EXAMPLES = Path(rospkg.RosPack().get_path("crazyflie_py")) / "examples"
LIMIT = 90.0  #: Of a script, s.

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


FLYING = """
import pathlib, sys, rospy
from pycrazyswarm import Crazyswarm

swarm = Crazyswarm()
# After a landing a vehicle cannot fly for a moment.
while not all(cf.get_status()["supervisor"] & 8 for cf in swarm.allcfs.crazyflies):
    swarm.timeHelper.sleep(0.1)
swarm.allcfs.takeoff(0.8, 2.0)
swarm.timeHelper.sleep(4.0)
pathlib.Path(sys.argv[1]).touch()
{ending}
"""


def ctrl_c(process):
    """Send the signal of Ctrl-C to a script."""
    process.send_signal(signal.SIGINT)


def kill_node(_):
    """Ask a script's node to shut down, as rosnode kill does."""
    assert rosnode.kill_nodes(["/flier"]) == (["/flier"], [])


def run_until(folder, ending, end):
    """Run a script that takes off, then the lines ``ending``, until ``end(process)``.

    Return what it has complained of.
    """
    path, flies = folder / "flier.py", folder / "flies"
    path.write_text(FLYING.format(ending=ending))
    command = [sys.executable, str(path), str(flies), "__name:=flier"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            wait_until(lambda: flies.exists() or process.poll() is not None, "takeoff", LIMIT)
            if flies.exists():
                end(process)
            _, errors = process.communicate(timeout=LIMIT)
        finally:
            process.kill()
    assert flies.exists(), errors
    return errors
