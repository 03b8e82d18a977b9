"""Counting tests from the files that pytest, rostest and catkin write."""

import subprocess
import sys

import pytest

PYTEST = """<?xml version="1.0" encoding="utf-8"?><testsuites name="pytest tests">
<testsuite name="pytest" errors="0" failures="1" skipped="1" tests="4">
<testcase classname="test.test_a" name="test_good" time="0.1" />
<testcase classname="test.test_a" name="test_bad[1/2]" time="0.1">
<failure message="AssertionError: assert 1 == 2&#10;  +  where 1">details</failure></testcase>
<testcase classname="test.test_a" name="test_fixture">
<error message="no fixture">x</error></testcase>
<testcase classname="test.test_a" name="test_skipped"><skipped message="why" /></testcase>
</testsuite></testsuites>"""

ROSUNIT = """<?xml version="1.0" encoding="utf-8"?><testsuites name="pytest tests">
<testsuite name="pytest" errors="0" failures="0" skipped="0" tests="2">
<testcase classname="test.rostest_flight" name="test_up" />
<testcase classname="test.rostest_flight" name="test_down" /></testsuite></testsuites>"""

ROSTEST = """<?xml version="1.0" encoding="utf-8"?>
<testsuite errors="0" failures="{failures}" name="unittest.suite.TestSuite" tests="1" time="4.5">
<testcase classname="rostest.runner.RosTest" name="testflight" time="4.5">{complaint}</testcase>
<system-out>&lt;![CDATA[text]]&gt;</system-out></testsuite>"""

MISSING = """<?xml version="1.0" encoding="UTF-8"?>
<testsuite tests="1" failures="1" time="1" errors="0" name="rostest-test_flight.xml">
  <testcase name="test_ran" status="run" time="1" classname="Results">
    <failure message="Unable to find test results for rostest-test_flight.xml" type=""/>
  </testcase>
</testsuite>"""


@pytest.fixture
def folder(tmp_path):
    """Return a folder with the results of two packages, all of them passed."""
    write(tmp_path, "a/rostest-test_flight.xml", ROSTEST.format(failures=0, complaint=""))
    write(tmp_path, "a/rosunit-flight.xml", ROSUNIT)
    write(tmp_path, "b/pytest-test.xml", ROSUNIT)
    return tmp_path


def write(folder, name, text):
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)


def count(folder):
    """Return the exit status and the lines of the program."""
    command = [sys.executable, "-m", "crazyflie_dev.count_results", str(folder)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert result.stderr == ""
    return result.returncode, result.stdout.splitlines()


def test_what_rostest_and_its_node_both_tell_counts_once(folder):
    assert count(folder) == (0, ["4 passed, 0 failed"])


def test_failed_tests_are_named_with_their_file(folder):
    write(folder, "c/pytest-test.xml", PYTEST)
    assert count(folder) == (
        1,
        [
            "FAILED c/pytest-test.xml: test.test_a.test_bad[1/2]: AssertionError: assert 1 == 2",
            "FAILED c/pytest-test.xml: test.test_a.test_fixture: no fixture",
            "5 passed, 2 failed, 1 skipped",
        ],
    )


def test_rostest_that_died_without_results_failed(folder):
    (folder / "a/rosunit-flight.xml").unlink()
    assert count(folder)[1][-1] == "2 passed, 1 failed"
    complaint = "<failure type='AssertionError'>test [flight] did not generate results</failure>"
    text = ROSTEST.format(failures=1, complaint=complaint)
    write(folder, "a/rostest-test_flight.xml", text)
    status, lines = count(folder)
    assert status == 1
    assert lines == [
        "FAILED a/rostest-test_flight.xml: rostest.runner.RosTest.testflight: "
        "test [flight] did not generate results",
        "2 passed, 1 failed",
    ]


def test_rostest_that_timed_out_failed_though_there_are_results(folder):
    text = ROSTEST.format(failures=1, complaint="<error type='x'>timeout</error>")
    write(folder, "a/rostest-test_flight.xml", text)
    assert count(folder)[1][-1] == "4 passed, 1 failed"


def test_rostest_that_did_not_even_start_failed(folder):
    (folder / "a/rostest-test_flight.xml").unlink()
    (folder / "a/rosunit-flight.xml").unlink()
    write(folder, "a/MISSING-rostest-test_flight.xml", MISSING)
    status, lines = count(folder)
    assert status == 1
    assert lines[0].startswith("FAILED a/MISSING-rostest-test_flight.xml: Results.test_ran: Unable")
    assert lines[-1] == "2 passed, 1 failed"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "not XML"),
        ("<testsuites><testsuite", "not XML"),
        ('<testsuites><testsuite tests="0" /></testsuites>', "no test ran"),
    ],
)
def test_files_without_a_test_failed(folder, text, reason):
    write(folder, "c/pytest-test.xml", text)
    status, lines = count(folder)
    assert status == 1
    assert lines[0].startswith(f"FAILED c/pytest-test.xml: {reason}")
    assert lines[-1] == "4 passed, 1 failed"


def test_nothing_ran(tmp_path):
    assert count(tmp_path) == (1, ["0 passed, 0 failed"])
    assert count(tmp_path / "nowhere") == (1, ["0 passed, 0 failed"])


def test_skipped_alone_is_nothing(tmp_path):
    text = '<testsuite><testcase name="a"><skipped /></testcase></testsuite>'
    write(tmp_path, "c/pytest-test.xml", text)
    assert count(tmp_path) == (1, ["0 passed, 0 failed, 1 skipped"])
