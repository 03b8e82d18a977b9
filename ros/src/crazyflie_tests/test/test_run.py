"""The script ``run``: its words, and what ``./run test`` says and returns when tests fail."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import workspaces
import yaml
from workspaces import TOP, clean_environment

LIMIT = 300.0

FAILING = Path(__file__).with_name("failing.test")


@pytest.fixture
def run_test(tmp_path, home):
    """Return a function that calls ``./run test`` and returns its status and what it printed."""
    top = tmp_path / "view"
    top.mkdir()
    workspaces.view(top)

    def run(*arguments):
        result = subprocess.run(
            ["./run", "test", *map(str, arguments)],
            cwd=top,
            env=clean_environment(home),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=LIMIT,
        )
        return result.returncode, result.stdout

    return run


@pytest.fixture
def folder(tmp_path):
    """Return a folder with a unit test that fails, and one that passes."""
    folder = tmp_path / "test"
    folder.mkdir()
    (folder / "test_failing.py").write_text("def test_fails():\n    assert 2 + 2 == 5\n")
    (folder / "test_passing.py").write_text("def test_passes():\n    pass\n")
    return folder


def test_failures_make_the_status(run_test, folder):
    # Later passes must not hide a failure, neither a rostest's nor a unit test's.
    passing = folder / "test_passing.py"
    status, printed = run_test(FAILING, passing)
    assert status == 1, printed
    assert printed.count("assert (2 + 2) == 5") > 0
    files = [folder / "test_failing.py", f"{folder / 'test_failing.py'}::test_fails"]
    status, printed = run_test(folder, *files, passing)
    assert status == 1, printed
    assert len(re.findall("^E +assert .2 . 2. == 5", printed, re.MULTILINE)) == 3
    assert len(re.findall("^[0-9]+ passed", printed, re.MULTILINE)) == 1


@pytest.mark.parametrize(
    ("argument", "complaint"),
    [
        ("docs/none.test", "there is no package, folder or file docs/none.test"),
        ("launch_shared", "there are no unit tests"),
        ("ros/src/crazyflie_tests/test/rostest_flight.py", "name the .test file that starts it"),
    ],
)
def test_what_cannot_be_tested_is_reported(run_test, argument, complaint):
    status, printed = run_test(argument)
    assert status == 1
    assert complaint in printed


@pytest.mark.parametrize("command", ["./run demo", "source setup.bash"])
def test_a_path_with_a_space_is_refused(command, tmp_path):
    folder = tmp_path / "a workspace"
    folder.mkdir()
    for file in ("run", "docs/course/setup.bash"):
        shutil.copy(TOP / file, folder)
    result = subprocess.run(
        ["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=10
    )
    assert result.returncode == 1
    assert "catkin cannot build in a path with a space" in result.stderr


FINDER = {
    "package.xml": """<package format="3"><name>finder</name><version>1.0.0</version>
<description>Finds a tool.</description><maintainer email="m@example.org">M</maintainer>
<license>BSD</license><buildtool_depend>catkin</buildtool_depend></package>""",
    "CMakeLists.txt": """cmake_minimum_required(VERSION 3.5)
project(finder)
find_package(catkin REQUIRED)
catkin_package()
find_file(TOOL tool PATHS ${CMAKE_SOURCE_DIR}/../tools NO_DEFAULT_PATH)
file(WRITE ${CMAKE_BINARY_DIR}/found "${TOOL}")
""",
}


def test_a_build_finds_what_was_installed_after_the_last_one(tmp_path):
    # As rostest is, which ./run demo does not need and ./run tests does.
    shutil.copy(TOP / "run", tmp_path)
    ros = tmp_path / "ros"
    (ros / "src" / "finder").mkdir(parents=True)
    for name, text in FINDER.items():
        (ros / "src" / "finder" / name).write_text(text)
    found = []
    for packages in ("# none\n", "# a tool\n"):
        for name in ("debian.txt", "requirements.txt"):
            (ros / name).write_text(packages)
        subprocess.run(["./run", "build"], cwd=tmp_path, check=True, timeout=LIMIT)
        found.append((ros / "build" / "found").read_text())
        (ros / "tools").mkdir(exist_ok=True)
        (ros / "tools" / "tool").touch()
    assert [Path(each).name for each in found] == ["TOOL-NOTFOUND", "tool"]


def test_a_workspace_that_was_copied_or_moved_is_built_anew(tmp_path):
    first, copied, moved = (tmp_path / name for name in ("first", "copied", "moved"))
    package = first / "ros" / "src" / "finder"
    package.mkdir(parents=True)
    shutil.copy(TOP / "run", first)
    for name, text in FINDER.items():
        (package / name).write_text(text)
    for name in ("debian.txt", "requirements.txt"):
        (first / "ros" / name).write_text("# none\n")
    subprocess.run(["./run", "build"], cwd=first, check=True, timeout=LIMIT)
    shutil.copytree(first, copied, symlinks=True)
    first.rename(moved)
    for folder in (copied, moved):
        subprocess.run(["./run", "install"], cwd=folder, check=True, timeout=LIMIT)
        subprocess.run(["./run", "build"], cwd=folder, check=True, timeout=LIMIT)
        sourced = (
            "source ros/devel/setup.bash && rospack find finder && ros/.venv/bin/pip --version"
        )
        found = subprocess.check_output(["bash", "-c", sourced], cwd=folder, text=True)
        place, pip = found.splitlines()
        assert place == str(folder / "ros" / "src" / "finder")
        assert f" {folder}/ros/.venv/" in pip


def test_a_section_on_demand_is_not_installed_with_all_others(tmp_path):
    shutil.copy(TOP / "run", tmp_path)
    (tmp_path / "ros").mkdir()
    debian = "# [a] what all need\nbash\n\n# [b] on demand: no such package\nno-such-package\n"
    (tmp_path / "ros" / "debian.txt").write_text(debian)
    (tmp_path / "ros" / "requirements.txt").write_text("# none\n")
    installed = subprocess.run(
        ["./run", "install"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )
    assert installed.returncode == 0, installed.stderr
    assert "no-such-package" not in installed.stderr


@pytest.mark.parametrize(
    ("word", "hint"),
    [("docotr", "did you mean doctor?"), ("xyz", "./run help lists all words")],
)
def test_a_word_that_is_not_there_gets_the_nearest_one(word, hint):
    result = subprocess.run([TOP / "run", word], capture_output=True, text=True, check=False)
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == f"run: there is no '{word}'; {hint}\n"


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ("install nope", "install of 'nope': expected sections of ros/debian.txt: batch "),
        ("docs index", "docs takes no arguments, and was given 'index'"),
        ("lint src docs", "lint takes no arguments, and was given 'src docs'"),
        ("build demo", "build takes no arguments, and was given 'demo'"),
        ("tests --all x", "tests takes no '--all x'"),
        ("course 1 2", "course '1 2': expected the number of a lesson"),
        ("swarm x", "swarm of x; expected one number of vehicles"),
        ("swarm 2 n:=3", "swarm of 2 3; expected one number of vehicles"),
        ("mission README.md", "mission of 'README.md': expected a script that exists"),
    ],
)
def test_arguments_are_refused_at_once(words, complaint):
    result = subprocess.run(
        [TOP / "run", *words.split()], capture_output=True, text=True, check=False, timeout=10
    )
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr.startswith(f"run: {complaint}")


def test_the_help_of_a_swarm_is_its_own():
    """It was that of mission, with a script that swarm does not take."""
    command = [TOP / "run", "swarm", "--help"]
    said = subprocess.run(command, capture_output=True, text=True, check=True)
    assert said.stdout.startswith("usage: run swarm [n|NAME:=VALUE ...]")


def test_words_used_elsewhere_exist():
    usage = subprocess.run([TOP / "run", "help"], capture_output=True, text=True, check=True).stdout
    words = set(re.findall(r"^  (\w+) ", usage, re.MULTILINE))
    workflow = yaml.safe_load((TOP / ".github" / "workflows" / "tests.yml").read_text())
    for name, job in workflow["jobs"].items():
        commands = "\n".join(step.get("run", "") for step in job["steps"])
        used = re.findall(r"\./run (\w+)", commands)
        assert name in used or not used
        assert set(used) <= words
