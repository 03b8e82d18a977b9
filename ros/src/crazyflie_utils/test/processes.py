"""Nodes in processes of their own, for the rostests."""

import contextlib
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import rospy
from roslib.packages import find_node

from crazyflie_utils.testing.peer import LIMIT

_TEST = Path(__file__).resolve().parent


class NodeProcess:
    """A process with its output."""

    def __init__(self, arguments):
        paths = [str(_TEST), os.environ.get("PYTHONPATH", "")]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        environment.pop("ROS_NAMESPACE", None)
        self._begin = time.monotonic()
        self._process = subprocess.Popen(
            arguments,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=environment,
        )
        self.output = ""
        self.duration = None
        # Read from the beginning: a full pipe would stop the process.
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def signal(self, number):
        self._process.send_signal(number)

    def is_running(self):
        return self._process.poll() is None

    def wait(self):
        """Return the exit status; `duration` and `output` are known then."""
        status = self._process.wait(LIMIT)
        self._reader.join(LIMIT)
        return status

    def end(self):
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait(LIMIT)

    def _read(self):
        for line in self._process.stdout:
            self.output += line
        self._process.wait()
        self.duration = time.monotonic() - self._begin


@contextlib.contextmanager
def _ended(process):
    try:
        yield process
    finally:
        process.end()


def small_node(class_name, name, *parameters):
    """Run one of small_nodes.py; parameters such as "_gain:=1" in YAML."""
    script = str(_TEST / "small_nodes.py")
    return _ended(NodeProcess([sys.executable, script, class_name, f"__name:={name}", *parameters]))


def composed(name, *arguments, **nodes):
    """Run a composed_node; ``nodes`` is node name = class in small_nodes.py."""
    if nodes:
        rospy.set_param(f"/{name}/nodes", {key: f"small_nodes:{nodes[key]}" for key in nodes})
    [script] = find_node("crazyflie_utils", "composed_node")
    return _ended(NodeProcess([sys.executable, script, f"__name:={name}", *arguments]))
