"""Packages that are made: what is in them, what is refused, and that they build, run and lint."""

import itertools
import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from crazyflie_package_generator.generator import GeneratorError, Package, check_name, main
from crazyflie_utils.parameters.tables import with_tables

BUILD_LIMIT = 900.0
PACKAGES = (("wall_follower", "follower", False), ("an_apple", "pear_tree", True))
"""One whose name is behind those of the workspace, and one before them, with a message."""


def repository():
    """Return the folder with ruff.toml, above this file."""
    return next(f for f in Path(__file__).resolve().parents if (f / "ruff.toml").exists())


LINTERS = repository() / "ros" / ".venv-lint" / "bin"


def make(folder, name, node, messages):
    return main([name, "--node", node, "--folder", str(folder), *["--messages"] * messages])


@pytest.fixture(scope="module")
def overlay(tmp_path_factory):
    """Return a workspace, not built, with both packages."""
    folder = tmp_path_factory.mktemp("overlay")
    (folder / "src").mkdir()
    for package in PACKAGES:
        assert make(folder / "src", *package) == 0
    return folder


def run(*command, folder, **more):
    done = subprocess.run(
        list(map(str, command)),
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=BUILD_LIMIT,
        **more,
    )
    assert done.returncode == 0, f"{command}:\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_structure(overlay):
    files = {
        str(path.relative_to(overlay / "src" / "an_apple"))
        for path in (overlay / "src" / "an_apple").rglob("*")
        if path.is_file()
    }
    assert files == {
        "CHANGELOG.rst",
        "CMakeLists.txt",
        "README.md",
        "config/pear_tree.yaml",
        "exec/pear_tree_node",
        "launch/pear_tree.launch",
        "msg/Smoothed.msg",
        "mypy.ini",
        "package.xml",
        "ruff.toml",
        "setup.py",
        "src/an_apple/__init__.py",
        "src/an_apple/pear_tree.py",
        "src/an_apple/pear_tree_node.py",
        "test/pear_tree.test",
        "test/rostest_pear_tree.py",
        "test/test_pear_tree.py",
    }
    assert not (overlay / "src" / "wall_follower" / "msg").exists()
    assert os.access(overlay / "src" / "an_apple" / "exec" / "pear_tree_node", os.X_OK)
    assert (
        "class PearTreeNode(Node)"
        in (overlay / "src" / "an_apple" / "src" / "an_apple" / "pear_tree_node.py").read_text()
    )


def test_nothing_is_left_to_fill_in(overlay):
    for path in overlay.rglob("*"):
        assert not re.search("PACKAGE|NODE", path.name)
        if path.is_file():
            assert not re.search(r"@\w+( \w+)?@", path.read_text()), path


def test_the_algorithm_knows_no_ros(overlay):
    for name, node, _ in PACKAGES:
        text = (overlay / "src" / name / "src" / name / f"{node}.py").read_text()
        assert re.findall(r"^(?:from|import) (\S+)", text, re.MULTILINE) == ["math"]


def test_builds_and_passes_its_tests(overlay):
    # No master is used but those that rostest starts.
    environment = {**os.environ, "ROS_IP": "127.0.0.1", "ROS_HOME": str(overlay / "home")}
    for target in ((), ("run_tests", "-j1")):
        run("catkin_make", "-C", overlay, *target, folder=overlay, env=environment)
    results = run("catkin_test_results", "build/test_results", folder=overlay, env=environment)
    # Unit tests, those of the rostest, and rostest's own for each package.
    count = re.search(r"(\d+) tests, 0 errors, 0 failures, 0 skipped", results)
    assert int(count[1]) >= 2 * (6 + 1)
    for name, node, _ in PACKAGES:
        folder = overlay / "build" / "test_results" / name
        assert list(folder.glob("pytest-*.xml"))
        assert list(folder.glob(f"*{node}*.xml"))


@pytest.fixture(scope="module")
def linters():
    """Return where ruff and mypy are."""
    if not (LINTERS / "mypy").exists():
        subprocess.run(["./run", "linters"], cwd=repository(), capture_output=True, timeout=600)
    return LINTERS


@pytest.mark.parametrize("name", [name for name, *_ in PACKAGES])
def test_lints(overlay, linters, tmp_path_factory, name):
    folder = overlay / "src" / name
    run(linters / "ruff", "check", "--no-cache", ".", folder=folder)
    run(linters / "ruff", "format", "--no-cache", "--check", ".", folder=folder)
    environment = {**os.environ, "MYPYPATH": ""}
    # Modules that both packages import.
    cache = tmp_path_factory.getbasetemp() / "mypy_cache"
    run(linters / "mypy", f"--cache-dir={cache}", folder=folder, env=environment)
    run("catkin_lint", "--strict", folder, folder=folder)


def test_the_rules_are_the_workspaces(overlay):
    theirs, ours = (
        tomllib.loads(path.read_text())
        for path in (overlay / "src" / "an_apple" / "ruff.toml", repository() / "ruff.toml")
    )
    for key in ("line-length", "target-version"):
        assert theirs[key] == ours[key]
    for key in ("select", "ignore", "pydocstyle", "flake8-annotations"):
        assert theirs["lint"][key] == ours["lint"][key]


def test_the_table_of_parameters_is_as_declared(overlay, monkeypatch):
    folder = overlay / "src" / "wall_follower"
    monkeypatch.syspath_prepend(str(folder / "src"))
    page = (folder / "README.md").read_text()
    assert page == with_tables(page)


@pytest.mark.parametrize("name", ["a1", "wall_follower", "x_2_y", "crazyflie_sweep"])
def test_names_of_packages(name):
    check_name("package", name)


@pytest.mark.parametrize(
    "name",
    ["", "a", "2d", "Wall", "wall-follower", "wall__follower", "_wall", "wall_", "wäll", "a b"]
    + ["../wall", "wall/follower", "class", "wall.follower", "@node@"],
)
@pytest.mark.parametrize("what", ["package", "node"])
def test_no_names(tmp_path, capsys, name, what):
    names = {"package": "wall_follower", "node": "follower", what: name}
    assert make(tmp_path, names["package"], names["node"], False) == 1
    assert f"{name!r} is not a valid name of a {what}; expected" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("package", "reason"),
    [
        (Package("string", "follower"), "'string' is a module of Python itself"),
        (Package("wall", "follower_node"), "expected it without _node"),
        (Package("wall", "follower", email="<x>"), "'<x>' is not a valid email"),
        (Package("wall", "follower", maintainer=" "), "' ' is not a valid maintainer"),
    ],
)
def test_other_refusals(package, reason):
    with pytest.raises(GeneratorError, match=reason):
        package.check()


@pytest.mark.parametrize("kind", ["folder", "file", "dangling link"])
def test_what_exists_is_left_alone(tmp_path, capsys, kind):
    place = tmp_path / "wall"
    {
        "folder": place.mkdir,
        "file": place.touch,
        "dangling link": lambda: place.symlink_to("nowhere"),
    }[kind]()
    before = place.lstat()
    assert make(tmp_path, "wall", "follower", False) == 1
    assert "already; expected the name of a new package" in capsys.readouterr().err
    assert place.lstat() == before
    assert list(tmp_path.iterdir()) == [place]


def test_a_folder_that_is_not_there(tmp_path, capsys):
    assert make(tmp_path / "src", "wall", "follower", False) == 1
    assert "there is no folder" in capsys.readouterr().err


def test_nothing_is_left_half_written(tmp_path, capsys, monkeypatch):
    written = itertools.count()
    write = Path.write_text

    def fail_at_the_fifth(path, text):
        if next(written) == 4:
            raise OSError("No space left on device")
        return write(path, text)

    monkeypatch.setattr(Path, "write_text", fail_at_the_fifth)
    assert make(tmp_path, "wall", "follower", False) == 1
    assert "cannot be written: No space left" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_wrong_usage(capsys):
    with pytest.raises(SystemExit) as end:
        main(["wall"])
    assert end.value.code == 2
    assert "--node" in capsys.readouterr().err
