"""Nodes that die in flight are started again; the vehicle flies on, or is brought down."""

import os
import signal
from xmlrpc.client import ServerProxy

import pytest
import rosgraph

from crazyflie_reports.flight_operator import ready_operator
from crazyflie_utils.testing.peer import wait_until

NODES = ("/takeoff_control_filter", "/takeoff_server", "/lqr_controller", "/state_estimator")
LOWEST = 0.8
"""The vehicle does not sink below this while a node is missing, m.

Without a state it begins to sink, 0.13 m in the 1.6 s after which the flight would be over.
"""


def process_id(node):
    """Return the process id of a node; None if it cannot be reached."""
    try:
        uri = rosgraph.Master("/dying_nodes").lookupNode(node)
        return ServerProxy(uri).getPid("/dying_nodes")[2]
    except (OSError, rosgraph.MasterError):
        return None


def kill(node):
    """Kill a node, and wait until it has been restarted."""
    first = process_id(node)
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: process_id(node) not in (None, first), f"another {node}")


@pytest.fixture(scope="module")
def record():
    """Fly once, and kill one node after the other."""
    with ready_operator() as operator:
        operator.takeoff()
        for node in NODES:
            kill(node)
            operator.hover(3.0)
        operator.land()
        return operator.finish()


def test_flies_on(record):
    heights = record.state.between(record.events["flying"], record.events["land"])[:, 2]
    assert heights.min() > LOWEST


def test_lands(record):
    assert record.state.last[2] < 0.01
    assert record.final_control.last[3] == 0.0
