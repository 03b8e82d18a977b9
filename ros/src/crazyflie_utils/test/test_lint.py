"""The whole workspace is clean for its linters."""

import subprocess
from pathlib import Path


def top():
    """Return the folder with ruff.toml, above this file."""
    for folder in Path(__file__).resolve().parents:
        if (folder / "ruff.toml").exists():
            return folder
    raise FileNotFoundError("no ruff.toml above this file: run this test from the source tree")


def test_is_clean():
    result = subprocess.run(
        ["./run", "lint"], cwd=top(), capture_output=True, text=True, timeout=600
    )
    assert result.returncode == 0, result.stdout + result.stderr
