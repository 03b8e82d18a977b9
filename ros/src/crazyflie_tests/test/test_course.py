"""The exercises of the course, and the word that opens a lesson."""

import os
import re
import shutil
import subprocess
import sys

import pytest
from workspaces import TOP

COURSE = TOP / "docs" / "course"
BUILD_LIMIT = 300.0
"""s; a build takes about 15."""

NEEDS_BUILD = {"logbook"}
"""Its other tests import its messages: test_the_logbook_is_built does it."""

PACKAGES = [path for path in sorted(COURSE.glob("skeletons/*/*")) if path.name not in NEEDS_BUILD]


def failures(folders, arguments=(), files="test_*.py"):
    """Run the tests of packages in one process; return the names of those that have failures."""
    paths = [str(folder / "src") for folder in folders]
    tests = [str(test) for folder in folders for test in sorted((folder / "test").glob(files))]
    packages = os.pathsep.join([*map(str, folders), os.environ["ROS_PACKAGE_PATH"]])
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--tb=no", "-p", "no:cacheprovider"]
        + ["-p", "crazyflie_utils.testing.pytest_plugin", *arguments, *tests],
        env={
            **os.environ,
            "COURSE": str(COURSE),
            "PYTHONPATH": os.pathsep.join([*paths, os.environ["PYTHONPATH"]]),
            "ROS_PACKAGE_PATH": packages,
        },
        capture_output=True,
        text=True,
        timeout=BUILD_LIMIT,
        check=False,
    )
    assert " passed" in result.stdout or " failed" in result.stdout, result.stdout + result.stderr
    return set(re.findall(r"^(?:FAILED|ERROR) .*?(\w+)/test/", result.stdout, re.MULTILINE))


def make(package, folder, is_solved):
    """Make the package of an exercise as a student has it, or the solved one; return its folder."""
    if not (package / "package.xml").exists():
        # The generator of the workspace makes it in the lesson.
        command = ["rosrun", "crazyflie_package_generator", "create_package", package.name]
        subprocess.run([*command, "--node", "median"], cwd=folder, check=True, capture_output=True)
    sources = [package, COURSE / "solutions" / package.parent.name / package.name]
    for source in sources[: 1 + is_solved]:
        shutil.copytree(source, folder / package.name, dirs_exist_ok=True)
    return folder / package.name


def test_skeletons_fail_and_solutions_pass(tmp_path):
    for is_solved in (False, True):
        folder = tmp_path / str(is_solved)
        folder.mkdir()
        folders = [make(package, folder, is_solved) for package in PACKAGES]
        failing = set() if is_solved else {package.name for package in PACKAGES}
        assert failures(folders) == failing


@pytest.mark.parametrize("is_solved", [False, True])
def test_the_types_of_the_logbook_are_checked_before_it_is_built(tmp_path, is_solved):
    folder = make(COURSE / "skeletons" / "5" / "logbook", tmp_path, is_solved)
    failing = set() if is_solved else {"logbook"}
    assert failures([folder], ["-k", "not builds"], "test_types.py") == failing


# Quick: the test above; --all also follows the lesson.
@pytest.mark.long
def test_the_logbook_is_built(tmp_path):
    folder = make(COURSE / "skeletons" / "5" / "logbook", tmp_path, is_solved=True)
    assert failures([folder], files="test_types.py") == set()


SOLVED = [path for path in sorted(COURSE.glob("solutions/*/*/**/*")) if path.is_file()]


@pytest.mark.parametrize("path", SOLVED, ids=lambda path: str(path.relative_to(COURSE)))
def test_a_solution_differs_from_its_skeleton(path):
    skeleton = COURSE / "skeletons" / path.relative_to(COURSE / "solutions")
    assert not skeleton.exists() or skeleton.read_text() != path.read_text()


@pytest.mark.parametrize("path", sorted(COURSE.glob("[0-9]*.md")), ids=lambda path: path.name)
def test_no_solution_stands_on_the_page_of_its_exercise(path):
    shown = re.findall(r"<!-- from: docs/course/solutions/(\S+) -->", path.read_text())
    headings = re.findall(r"^## Solutions?$", path.read_text(), re.MULTILINE)
    assert (shown, headings) == ([], [])
    if re.search(r"^## Exercises?", path.read_text(), re.MULTILINE):
        assert f"](solutions/{path.name})" in path.read_text()


@pytest.mark.parametrize("lesson", ["", "0", "99", "3x"])
def test_a_lesson_that_there_is_not_is_refused(lesson):
    result = subprocess.run(
        [TOP / "run", "course", lesson], capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 1
    assert f"course '{lesson}': expected the number of a lesson" in result.stderr


def in_a_terminal(home, commands):
    """Run commands in a terminal of the course that builds nothing; return what it prints."""
    return subprocess.run(
        ["bash", "-c", f"source {COURSE}/setup.bash; build() {{ true; }}; {commands}"],
        env={**os.environ, "HOME": str(home)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def test_no_file_of_a_student_is_lost(tmp_path):
    mine = tmp_path / "my_workspace/src/four_vehicles/src/four_vehicles/mission.py"
    in_a_terminal(tmp_path, "exercise 12")
    assert "step 1" in mine.read_text()
    mine.write_text("mine")
    in_a_terminal(tmp_path, "exercise 12")
    assert mine.read_text() == "mine"
    in_a_terminal(tmp_path, "solution 12")
    assert "formation" in mine.read_text()
    assert mine.with_name("mission.py.mine").read_text() == "mine"


def test_an_exercise_that_needs_a_package_of_the_lesson_says_so(tmp_path):
    result = in_a_terminal(tmp_path, "exercise 2")
    assert result.returncode == 1
    assert "make the package spike_filter first" in result.stderr
    assert not (tmp_path / "my_workspace").exists()


def test_the_launch_of_a_lesson_is_shown_as_it_is_called(tmp_path):
    stubs = """export LESSON=5; unset DISPLAY
        roslaunch() { [ "$1" = --nodes ] || echo "$@" >>~/called; }
        rostopic() { [ -e ~/called ]; }"""
    shown = in_a_terminal(tmp_path, f"{stubs}\nexercise() {{ :; }}; source {COURSE}/shell.bash")
    (called,) = (tmp_path / "called").read_text().splitlines()
    assert "sim_time:=true" in called
    assert f"Launched: roslaunch {called}\n" in shown.stdout
