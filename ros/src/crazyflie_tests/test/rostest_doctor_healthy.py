"""The doctor finds nothing in a graph that is well, and leaves nothing behind."""

import rosgraph
from doctor_runs import about, run_doctor

from crazyflie_utils.testing.peer import wait_until

OF_THE_GRAPH = (
    "nodes",
    "types",
    "connections",
    "publishers",
    "clock",
    "tf tree",
    "frames",
    "tf rate",
    "gains",
    "drivers",
)


def nodes():
    state = rosgraph.Master("/looker").getSystemState()
    return {node for part in state for _, names in part for node in names}


def test_finds_nothing():
    launched = {"/composed", "/robot_base_link_publisher"}
    wait_until(lambda: launched <= nodes(), "the nodes of the launch file")
    before = nodes()
    status, lines = run_doctor()
    for check in OF_THE_GRAPH:
        assert about(check, lines).startswith("ok "), "\n".join(lines)
    assert status == 0
    assert nodes() == before
