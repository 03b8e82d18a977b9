"""A bad parameter stops the process, and says which it was."""

import re

import pytest
import rospy
from processes import composed, small_node

GOOD = "_time_step:=0.01"
EXPECTED = "expected a finite number >= 0.0001 (s)"
BAD = {
    "missing": [],
    "of the wrong type": ["_time_step:=fast"],
    "not a number": ["_time_step:=.nan"],
    "negative": ["_time_step:=-0.01"],
}


@pytest.fixture(scope="session")
def report(record_testsuite_property):
    """Return a function that puts into the results how long a process has lived."""
    return lambda case, process: record_testsuite_property(
        f"seconds until exit, parameter {case}", f"{process.duration:.2f}"
    )


@pytest.mark.parametrize("case", BAD)
def test_node_exits(case, report):
    name = "bad_" + case.replace(" ", "_")
    with small_node("Ticker", name, *BAD[case]) as process:
        assert process.wait() == 1
    assert f"parameter /{name}/time_step is " in process.output
    assert EXPECTED in process.output
    report(case, process)


def test_use_sim_time_must_be_true_or_false():
    rospy.set_param("/use_sim_time", "maybe")
    try:
        with small_node("Ticker", "bad_sim_time", GOOD) as process:
            assert process.wait() == 1
    finally:
        rospy.delete_param("/use_sim_time")
    assert "parameter /use_sim_time" in process.output


def test_node_that_cannot_be_made_exits():
    with small_node("Broken", "broken") as process:
        assert process.wait() == 1
    assert "broken by design" in process.output


def test_composed_node_exits_for_the_parameter_of_one_node(report):
    rospy.set_param("/good_one/time_step", 0.01)
    rospy.set_param("/bad_one/time_step", -1.0)
    with composed("one_bad", good_one="Ticker", bad_one="Ticker") as process:
        assert process.wait() == 1
    assert f"parameter /bad_one/time_step is -1.0; {EXPECTED}" in process.output
    assert "/good_one" not in process.output
    report("of one node of two", process)


@pytest.mark.parametrize("path", ["small_nodes:Nobody", "no_such_module:Ticker"])
def test_composed_node_exits_for_a_bad_class_path(path):
    name = "bad_path_" + re.sub(r"\W", "_", path)
    rospy.set_param(f"/{name}/nodes", {"a": "small_nodes:Ticker", "b": path})
    with composed(name) as process:
        assert process.wait() == 1
    assert f"parameter /{name}/nodes is " in process.output
    assert f"no class '{path}'" in process.output


def test_composed_node_exits_without_a_list_of_nodes():
    with composed("no_list") as process:
        assert process.wait() == 1
    assert "parameter /no_list/nodes is not set; expected a dictionary of" in process.output
