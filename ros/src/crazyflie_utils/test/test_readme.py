"""The README's examples work."""

import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from crazyflie_utils.parameters import types as parameter_types
from crazyflie_utils.testing import FakeProcess

README = (Path(__file__).resolve().parents[1] / "README.md").read_text()
CONSTANTS = [name for name in vars(parameter_types) if name.isupper()]
METHODS = [name for name in dir(FakeProcess().handle("/node")) if not name.startswith("_")]


def blocks(language):
    """Return the texts of all code blocks in a language."""
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_example_passes_its_test(tmp_path):
    node, test = blocks("python")
    (tmp_path / "thrust_limiter_node.py").write_text(node)
    (tmp_path / "test_example.py").write_text(test)
    paths = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    result = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "test_example.py"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert "2 passed" in result.stdout, result.stdout + result.stderr


def test_launch_files_are_xml():
    assert [ElementTree.fromstring(text).tag for text in blocks("xml")] == ["launch", "test"]


@pytest.mark.parametrize("name", CONSTANTS)
def test_every_constant_is_in_the_table(name):
    row = next(
        line for line in README.splitlines() if line.startswith("| `") and f"`{name}`" in line
    )
    assert row.endswith(f"| {getattr(parameter_types, name)} |")


@pytest.mark.parametrize("name", METHODS)
def test_every_method_of_the_handle_is_in_the_table(name):
    assert re.search(rf"^\|.*`{name}[`(]", README, re.MULTILINE)
