"""The whole workspace is clean for ruff and for catkin_lint."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def top():
    """Return the folder with ruff.toml, above this file."""
    for folder in Path(__file__).resolve().parents:
        if (folder / "ruff.toml").exists():
            return folder
    raise FileNotFoundError("no ruff.toml above this file: run this test from the source tree")


def tool(name):
    """Return the path of a program, of the virtual environment first."""
    here = Path(sys.executable).with_name(name)
    path = str(here) if here.exists() else shutil.which(name)
    assert path, f"{name} is not installed; ./run install installs it"
    return path


@pytest.mark.parametrize(
    "command",
    [
        ["ruff", "check", "--no-cache", "."],
        ["ruff", "format", "--no-cache", "--check", "."],
        ["catkin_lint", "--strict", "ros/src"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_is_clean(command):
    result = subprocess.run(
        [tool(command[0]), *command[1:]], cwd=top(), capture_output=True, text=True, timeout=300
    )
    assert result.returncode == 0, result.stdout + result.stderr
