"""Copies of the workspace and shells to use them with."""

import os
import re
import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

from catkin_pkg.packages import find_packages
from terminal import Terminal

from crazyflie_utils.testing.programs import free_port

TOP = Path(__file__).resolve().parents[4]
"""Top of the repository."""

INSTALLATION = TOP / "docs" / "installation.md"
"""The page that tells how a workspace is built and installed."""

FLY = f"python3 {Path(__file__).with_name('fly.py')}"
"""Command that flies a launch file and checks the flight."""

FAST = "rviz:=false sim_time:=true real_time_factor:=0 simulator_dt:=0.01 composed:=true"
"""Arguments of sw_hover.launch that fly it in seconds."""

BUILD_LIMIT = 900.0
"""The longest that a build may take, s; it takes about 20."""

INSTALLED = {
    package.name: TOP / "ros" / "src" / path
    for path, package in find_packages(str(TOP / "ros" / "src")).items()
    if package.name not in ("crazyflie_dev", "crazyflie_tests") and not package.is_metapackage()
}
"""Packages that are installed -> where their sources are."""

_NOT_COPIED = (".git", ".venv*", "build", "devel", "install", "out", "__pycache__", ".hypothesis")


def copy(folder: Path) -> Path:
    """Copy the sources of the workspace to a folder and return it; Python packages are shared."""
    shutil.copytree(TOP, folder, symlinks=True, ignore=shutil.ignore_patterns(*_NOT_COPIED))
    for name in (".venv", ".venv-lint"):
        if (TOP / "ros" / name).exists():
            (folder / "ros" / name).symlink_to(TOP / "ros" / name)
    return folder


def view(folder: Path) -> Path:
    """Make a folder a view of the built workspace, with results of its own, and return it."""
    for entry in TOP.iterdir():
        if entry.name != "out":
            (folder / entry.name).symlink_to(entry)
    return folder


def clean_environment(home: Path) -> dict[str, str]:
    """Return the environment of a user who has sourced nothing and prefers another Python.

    The first python3 on the PATH is one that does not work; behind it is the PATH of
    this process without what this workspace has put there.
    """
    home.mkdir(exist_ok=True)
    other = home / "other_python"
    other.mkdir(exist_ok=True)
    for name in ("python", "python3"):
        (other / name).write_text("#!/bin/sh\necho this is the wrong python3 >&2\nexit 1\n")
        (other / name).chmod(0o755)
    inherited = os.environ["PATH"].split(os.pathsep)
    path = [str(other), *(entry for entry in inherited if not entry.startswith(str(TOP)))]
    # docs/installation.md has users of CMake 4 set this; ./run does.
    policy = "CMAKE_POLICY_VERSION_MINIMUM"
    return {
        **({policy: os.environ[policy]} if policy in os.environ else {}),
        "HOME": str(home),
        "LANG": "C.UTF-8",
        "PATH": os.pathsep.join(path),
        "ROS_IP": "127.0.0.1",
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port(socket.SOCK_STREAM)}",
    }


def programs_of(package: str) -> dict[str, str]:
    """Return the programs that CMake makes for a package, and "package.module:name" they call."""
    text = (INSTALLED[package] / "CMakeLists.txt").read_text()
    return dict(re.findall(r"^crazyflie_add_program\((\S+)\s+([\w.]+:\w+)", text, re.MULTILINE))


def code_of(script: Path) -> str:
    """Return a script without its first line."""
    return script.read_text().split("\n", 1)[1]


def data_of(package: str) -> Iterator[tuple[Path, Path]]:
    """Yield the data of an installed package: path in its share folder, and source."""
    top = INSTALLED[package]
    for folder in ("launch", "config", "references", "rviz", "urdf", "msg", "srv"):
        for source in (top / folder).rglob("*.*"):
            yield source.relative_to(top), source


def overlay(folder: Path, *packages: str) -> Path:
    """Make a workspace with packages of docs/examples, not built; return its folder."""
    for package in packages:
        source = TOP / "docs" / "examples" / package
        shutil.copytree(
            source, folder / "src" / package, ignore=shutil.ignore_patterns(*_NOT_COPIED)
        )
    return folder


def shell(folder: Path, home: Path) -> Terminal:
    """Return a shell in a folder, with a `clean_environment`."""
    return Terminal(folder, clean_environment(home))
