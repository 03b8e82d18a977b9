"""Running the tests of a workspace: what is repeated, what is flaky, what is left out."""

import subprocess
import sys

import pytest

CATKIN = "/usr/share/catkin/cmake/test/run_tests.py"

FLAKY = """
from pathlib import Path

def test_good():
    pass

def test_shy():
    ran = Path(__file__).with_name("ran")
    count = len(ran.read_text()) if ran.exists() else 0
    ran.write_text("x" * (count + 1))
    assert count > 0, "among others"
"""

BAD = """
import pytest

@pytest.mark.parametrize("word", ["1/2 a"])
def test_bad(word):
    assert word == "evidence"

@pytest.mark.long
def test_long():
    assert False
"""

LAUNCH = """
import sys
from pathlib import Path

report = Path(sys.argv[1])
report.parent.mkdir(parents=True, exist_ok=True)
ran = Path(__file__).with_name("ran")
is_first = not ran.exists()
ran.touch()
failure = "<failure message='among others'/>" if is_first else ""
check = f"<testcase classname='rostest_launch' name='test_shy'>{failure}</testcase>"
node = "<testcase classname='rostest.runner.RosTest' name='testlaunch'/>"
report.with_name("rosunit-launch.xml").write_text(f"<testsuite>{check}</testsuite>")
report.write_text(f"<testsuite tests='1' failures='0' errors='0'>{node}</testsuite>")
sys.exit(is_first)
"""

NO_MODULE = "import nowhere"


@pytest.fixture
def run(tmp_path):
    """Return a function that runs test files as ctest's, and returns status and lines."""
    (tmp_path / "build" / "package").mkdir(parents=True)
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = long: takes long\n")
    lines = []

    def call(*arguments, **files):
        for name, text in files.items():
            source = tmp_path / f"test_{name}.py"
            source.write_text(text)
            results = tmp_path / "build" / "test_results" / "package"
            if name == "launch":
                report = results / "rostest-launch.xml"
                command = f"{sys.executable} {source} {report}"
            else:
                report = results / f"pytest-{name}.xml"
                command = f"{sys.executable} -m pytest {source} -q --junit-xml={report}"
            words = ["/usr/bin/env", sys.executable, CATKIN, report, "--return-code", command]
            # ctest reads a list of CMake.
            lines.append(f"add_test({name} " + " ".join(f'"{word}"' for word in words) + ")")
            label = "LABELS long" if name == "whole" else ""
            folder = tmp_path / "build" / "package"
            lines.append(
                f'set_tests_properties({name} PROPERTIES WORKING_DIRECTORY "{folder}" {label})'
            )
        (tmp_path / "build" / "CTestTestfile.cmake").write_text("\n".join(lines))
        program = [sys.executable, "-m", "crazyflie_dev.run_tests", tmp_path / "build"]
        result = subprocess.run(
            [*program, *arguments], capture_output=True, text=True, check=False, timeout=120
        )
        return result.returncode, result.stdout.splitlines()

    return call


@pytest.mark.parametrize(("arguments", "expected"), [((), 0), (("--all",), 1)])
def test_what_passes_alone_is_flaky_and_no_pass(run, tmp_path, arguments, expected):
    status, lines = run(*arguments, flaky=FLAKY)
    assert status == expected
    assert lines[-2:] == [
        "1 passed, 0 failed, 1 flaky",
        "FLAKY: package/pytest-flaky.xml: test_flaky.test_shy",
    ]
    # Once among others, three times alone.
    assert (tmp_path / "ran").read_text() == "xxxx"
    results = tmp_path / "build" / "test_results" / "package" / "pytest-flaky.xml"
    assert "among others" in results.read_text()


def test_a_check_of_a_rostest_that_passes_alone_is_flaky_once(run):
    status, lines = run(launch=LAUNCH, good="def test_good(): pass")
    assert status == 0
    assert lines[-2:] == [
        "1 passed, 0 failed, 1 flaky",
        "FLAKY: package/rosunit-launch.xml: rostest_launch.test_shy",
    ]


def test_what_fails_alone_has_failed_and_what_is_long_is_left_out(run):
    status, lines = run(bad=BAD, whole=BAD)
    assert status == 1
    assert lines[-2].startswith("FAILED package/pytest-bad.xml: test_bad.test_bad[1/2 a]: ")
    assert "evidence" in lines[-2]
    assert lines[-1] == "0 passed, 1 failed"


def test_all_has_what_is_long(run):
    _, lines = run("--all", bad=BAD, whole=BAD)
    assert lines[-1] == "0 passed, 4 failed"


def test_a_program_without_a_test_has_failed(run):
    status, lines = run(dead=NO_MODULE)
    assert status == 1
    assert lines[-1] == "0 passed, 1 failed"


def test_good_ones_pass(run):
    assert run(good="def test_good(): pass")[0] == 0
    assert run("--nonsense")[0] == 2
