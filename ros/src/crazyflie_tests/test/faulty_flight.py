"""Fly the software example, and take away from it what it stands on.

Prints what was seen as JSON. Usage: faulty_flight.py [ARGUMENT:=VALUE ...]
"""

import json
import os
import resource
import signal
import socket
import sys
import tempfile
from pathlib import Path
from xmlrpc.client import ServerProxy

import numpy as np
import rosgraph

from crazyflie_reports.flight_operator import FlightOperator
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import complaints
from crazyflie_utils.testing.peer import wait_until
from crazyflie_utils.testing.programs import free_port, running

LIMIT = 60.0

NODES = (
    "/simulator",
    "/state_estimator",
    "/lqr_controller",
    "/takeoff_server",
    "/takeoff_control_filter",
)


class Observer:
    """Looks at a flight from outside, whether there is a master or not."""

    def __init__(self):
        self._process = begin("flight")
        self._operator = FlightOperator(self._process)
        self._operator.wait_until_ready()
        self.takeoff, self.land = self._operator.takeoff, self._operator.land
        self.hover, self.refer_to = self._operator.hover, self._operator.refer_to
        self.record = self._operator.finish
        self._state = self._operator.record.state

    @property
    def height(self):
        """Of the vehicle now, m."""
        return float(self._operator.position[2])

    @property
    def now(self):
        """Time of the last state, s."""
        return self._state.last_time

    def range_since(self, begin):
        """Return the least and the greatest height since a moment (s), m."""
        heights = self._state.between(begin, np.inf)[:, 2]
        return [float(heights.min()), float(heights.max())]

    def fastest_descent_since(self, begin):
        """Return the greatest speed downward since a moment (s), m/s."""
        return -float(self._state.between(begin, np.inf)[:, 5].min())


def node_process(node):
    """Return the process id of a node."""
    uri = rosgraph.Master("/flight").lookupNode(node)
    return ServerProxy(uri).getPid("/flight")[2]


def master_knows(*names):
    """Return whether the master knows these topics and services."""
    try:
        publishers, _, services = rosgraph.Master("/flight").getSystemState()
    except OSError:
        return False
    return set(names) <= {name for name, _ in publishers + services}


def fly(core_command, arguments, log):
    """Fly, and return what was seen: name -> figure."""
    seen = {}
    with log.open("w") as output, running(*core_command, stdout=output, stderr=output) as core:
        wait_until(rosgraph.is_master_online, "a master", LIMIT)
        # roslaunch waits for what roscore says of itself.
        rosgraph.Master("/flight").setParam("/run_id", "faulty_flight")
        launch = ["roslaunch", "--wait", "crazyflie_examples", "sw_hover.launch", "rviz:=false"]
        with running(*launch, *arguments, stdout=output, stderr=output) as roslaunch:
            observer = Observer()
            observer.takeoff()
            controller = node_process("/lqr_controller")

            begin = observer.now
            for node in NODES:
                resource.prlimit(node_process(node), resource.RLIMIT_FSIZE, (0, 0))
            for _ in range(10):
                observer.refer_to((np.nan, 0.0, 1.0))
                observer.hover(0.2)
            seen["heights with a full disk"] = observer.range_since(begin)

            begin = observer.now
            os.killpg(core.pid, signal.SIGKILL)
            core.wait()
            observer.hover(3.0)
            seen["heights without a master"] = observer.range_since(begin)
            with running(*core_command, stdout=output, stderr=output):
                wait_until(
                    lambda: master_knows("/state", "/control/final", "/land"), "to be known", LIMIT
                )

                begin = observer.now
                os.kill(controller, signal.SIGSTOP)
                wait_until(lambda: observer.height < 0.01, "the ground", LIMIT)
                os.kill(controller, signal.SIGCONT)
                seen["fastest descent without a controller"] = observer.fastest_descent_since(begin)
                begin = observer.now
                observer.hover(3.0)
                seen["heights after it has come back"] = observer.range_since(begin)

                begin = observer.now
                observer.takeoff()
                seen["heights of the second takeoff"] = observer.range_since(begin)
                begin = observer.now
                roslaunch.send_signal(signal.SIGINT)
                seen["status of roslaunch"] = roslaunch.wait(LIMIT)
                seen["height after Ctrl-C"] = observer.height
                seen["fastest descent after Ctrl-C"] = observer.fastest_descent_since(begin)
                seen["last thrust"] = float(observer.record().final_control.last[3])
    return seen


def main(arguments):
    """Fly and print."""
    port = free_port(socket.SOCK_STREAM)
    os.environ["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
    os.environ["ROS_IP"] = "127.0.0.1"
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "launch.log"
        try:
            seen = fly(["rosmaster", "--core", "-p", port], arguments, log)
        except BaseException:
            print(log.read_text(), file=sys.stderr)
            raise
        seen["complaints"] = complaints(log)
    print(json.dumps(seen, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
