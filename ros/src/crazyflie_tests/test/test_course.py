"""The exercises of the course: the tests of a skeleton fail, those of its solution pass."""

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
