"""How rostest's words become pytest's, and what an interrupt is."""

import subprocess
import sys
from xml.etree import ElementTree

from crazyflie_utils.testing.pytest_node import pytest_arguments

INTERRUPTED = """
import os, signal

def test_runs():
    os.kill(os.getpid(), signal.SIGINT)

def test_is_not_reached():
    pass
"""
MARKED = """
import pytest

@pytest.mark.slow
def test_is_slow():
    pass

# ./run tests deselects it.
@pytest.mark.long
def test_is_long():
    pass
"""
PROGRAM = """
import sys
import pytest
from crazyflie_utils.testing.pytest_node import InterruptIsFailure, pytest_arguments

sys.exit(pytest.main(pytest_arguments(sys.argv[1:]), plugins=[InterruptIsFailure()]))
"""


def run(*arguments):
    command = [sys.executable, "-c", PROGRAM, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, timeout=120)


def test_results_go_where_rostest_looks_for_them():
    arguments = pytest_arguments(["a.py", "b.py", "--gtest_output=xml:/tmp/r.xml"])
    assert arguments[:3] == ["a.py", "b.py", "--junit-xml=/tmp/r.xml"]


def test_text_mode_has_no_results():
    assert pytest_arguments(["a.py", "--text"])[:2] == ["a.py", "-p"]


def test_an_interrupt_is_a_failure(tmp_path):
    tests, results = tmp_path / "test_interrupted.py", tmp_path / "results.xml"
    tests.write_text(INTERRUPTED)
    assert run(tests, f"--gtest_output=xml:{results}").returncode == 1
    [case] = ElementTree.parse(results).getroot().iter("testcase")
    assert case.get("name") == "test_runs"
    assert "has a required node died?" in case.find("failure").get("message")


def test_a_package_has_its_own_markers_beside_that_of_long_tests(tmp_path):
    tests = tmp_path / "test_marked.py"
    tests.write_text(MARKED)
    (tmp_path / "pytest.ini").write_text(
        "[pytest]\naddopts = --strict-markers\nmarkers = slow: takes time\n"
    )
    assert run(tests).returncode == 0
