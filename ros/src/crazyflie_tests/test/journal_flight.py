"""Fly a launch file on a master of its own with journals, and kill nodes in flight.

Usage: journal_flight.py [--vehicle NAMESPACE ...] [--kill NODE ...] [--freeze NODE ...] FOLDER
PACKAGE FILE [ARGUMENT:=VALUE ...]

Nodes to freeze, such as a virtual vehicle, stand still for a time in flight.
"""

import argparse
import contextlib
import os
import signal
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph

from crazyflie_reports.flight_operator import FlightError, FlightOperator
from crazyflie_utils.main import begin
from crazyflie_utils.testing.launching import roslaunch
from crazyflie_utils.testing.programs import wait_until

HOVER_DURATION = 2.0
FROZEN_DURATION = 3.0  #: Long enough for the loss of a link, s.


def process_id(node):
    """Return the process id of a node; None if it cannot be reached."""
    try:
        uri = rosgraph.Master("/flight").lookupNode(node)
        return ServerProxy(uri).getPid("/flight")[2]
    except (OSError, rosgraph.MasterError):
        return None


def freeze(node):
    """Have a node stand still for a while."""
    process = process_id(node)
    os.kill(process, signal.SIGSTOP)
    time.sleep(FROZEN_DURATION)
    os.kill(process, signal.SIGCONT)


def fly(operators, nodes, frozen):
    """Fly all vehicles at the same time; kill nodes meanwhile, which are started again."""
    for operator in operators:
        operator.wait_until_ready()
    with ThreadPoolExecutor(len(operators)) as threads:
        list(threads.map(FlightOperator.takeoff, operators))
        for node in nodes:
            first = process_id(node)
            os.kill(first, signal.SIGKILL)
            wait_until(lambda node=node, first=first: process_id(node) not in (None, first), node)
            operators[0].hover(HOVER_DURATION)
        for node in frozen:
            freeze(node)
            operators[0].hover(HOVER_DURATION)
        operators[0].hover(HOVER_DURATION)
        # On a busy computer the filter has brought the vehicle down before a node was back.
        with contextlib.suppress(*([FlightError] if nodes or frozen else [])):
            list(threads.map(FlightOperator.land, operators))


def main():
    """Fly; return the exit status, 0 if all vehicles have landed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--vehicle", action="append", default=[])
    parser.add_argument("--kill", action="append", default=[])
    parser.add_argument("--freeze", action="append", default=[])
    parser.add_argument("folder", type=Path)
    parser.add_argument("launch", nargs="+")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "launch.log"
        with roslaunch([*options.launch, f"journal:={options.folder}"], log):
            process = begin("flight")
            names = options.vehicle or ["/"]
            operators = [FlightOperator(process, name, start=False) for name in names]
            process.start()
            try:
                fly(operators, options.kill, options.freeze)
            except FlightError as error:
                print(f"the flight failed: {error}\n{log.read_text()}", file=sys.stderr)
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
