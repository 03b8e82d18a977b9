"""Message of a program when a Python module is missing."""

import sys
from pathlib import Path

import pytest
import rospkg

from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.node import Node
from crazyflie_utils.program import PACKAGES, missing_module, run_program

SENTENCE = (
    "the Python module cv2 is missing; ./run install vision installs it, "
    "or apt install python3-opencv"
)


class Vision(Node):
    """A node that imports late."""

    def load_parameters(self, handle):
        import cv2  # noqa: F401


def see():
    """Import as a program does."""
    import cv2  # noqa: F401


@pytest.fixture
def no_cv2(monkeypatch, tmp_path):
    """Take OpenCV away, and return a module that imports it."""
    monkeypatch.setitem(sys.modules, "cv2", None)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "needs_opencv.py").write_text("import cv2.aruco\n")


@pytest.mark.usefixtures("no_cv2")
def test_a_node_names_the_module_and_what_installs_it(process):
    assert not process.launch(Vision(), "/vision")
    assert process.logged("error") == [f"/vision: {SENTENCE}"]


@pytest.mark.usefixtures("no_cv2")
def test_a_node_of_many_names_the_module_and_its_class():
    with pytest.raises(ValueError) as caught:
        NODE_CLASSES({"a": "needs_opencv:Vision"})
    assert str(caught.value) == f"no class 'needs_opencv:Vision': {SENTENCE}"
    assert missing_module(caught.value) == SENTENCE


@pytest.mark.usefixtures("no_cv2")
@pytest.mark.parametrize("path", ["needs_opencv:main", f"{__name__}:see"])
def test_a_program_ends_with_status_1_and_the_sentence(path, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/somewhere/track"])
    with pytest.raises(SystemExit) as caught:
        run_program(path)
    assert caught.value.code == f"track: {SENTENCE}"


def test_what_comes_from_pypi_is_installed_by_pip():
    text = missing_module(ModuleNotFoundError(name="nicegui.elements"))
    assert text.endswith("; ./run install dashboard installs it, or pip install nicegui")


@pytest.mark.parametrize(
    "error", [None, ModuleNotFoundError(name="my_modul"), ImportError("cv2"), ValueError("cv2")]
)
def test_other_errors_keep_their_traceback(error):
    assert missing_module(error) == ""


@pytest.mark.parametrize("module", ["no_such_module", "math"])
def test_a_program_that_does_not_exist_is_an_error_of_python(module):
    with pytest.raises((ModuleNotFoundError, AttributeError)):
        run_program(f"{module}:main")


def sections(path):
    """Return the packages of a list by section; those before the first one are in demo."""
    found, section = {}, "demo"
    for line in path.read_text().splitlines():
        if line.startswith("# ["):
            section = line[3:].partition("]")[0]
        name = line.partition("#")[0].partition("==")[0].strip()
        found.setdefault(name, section)
    return found


def test_packages_are_where_run_finds_them():
    """Also: each is in the section that is named."""
    ros = Path(rospkg.RosPack().get_path("crazyflie_utils")).resolve().parents[1]
    lists = sections(ros / "debian.txt") | sections(ros / "requirements.txt")
    assert {package: lists.get(package) for _, package in PACKAGES.values()} == {
        package: section for section, package in PACKAGES.values()
    }
