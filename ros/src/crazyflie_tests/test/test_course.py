"""The exercises of the course, and the word that opens a lesson."""

import os
import re
import shutil
import subprocess
import sys

import pytest
from workspaces import TOP

COURSE = TOP / "docs" / "course"
GENERATED = {"spike_filter", "logbook"}
"""Their other files, or their messages, need a build: test_commands follows their lessons."""

PACKAGES = [path for path in sorted(COURSE.glob("skeletons/*/*")) if path.name not in GENERATED]


def failures(packages):
    """Run the tests of packages in one process; return the names of those that have failures."""
    paths = [str(package / "src") for package in packages]
    tests = [str(test) for package in packages for test in sorted(package.glob("test/*.py"))]
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "--tb=no", "-p", "no:cacheprovider", *tests],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([*paths, os.environ["PYTHONPATH"]])},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert " passed" in result.stdout or " failed" in result.stdout, result.stdout + result.stderr
    return set(re.findall(r"^(?:FAILED|ERROR) .*?(\w+)/test/", result.stdout, re.MULTILINE))


def test_skeletons_fail_and_solutions_pass(tmp_path):
    assert failures(PACKAGES) == {package.name for package in PACKAGES}
    solved = []
    for package in PACKAGES:
        folder = tmp_path / package.name
        solution = COURSE / "solutions" / package.parent.name / package.name
        for source in (package, solution):
            shutil.copytree(source, folder, dirs_exist_ok=True)
        solved.append(folder)
    assert failures(solved) == set()


@pytest.mark.parametrize("path", sorted(COURSE.glob("solutions/*/*/**/*.py")), ids=lambda p: p.name)
def test_a_solution_differs_from_its_skeleton(path):
    skeleton = COURSE / "skeletons" / path.relative_to(COURSE / "solutions")
    if path.parts[path.parts.index("solutions") + 2] not in GENERATED:
        assert skeleton.read_text() != path.read_text()


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
