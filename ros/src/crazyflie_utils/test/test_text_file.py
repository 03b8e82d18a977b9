"""Files that users name: ~, relative paths, and where a missing file was looked for."""

import os

import pytest

from crazyflie_utils import ParameterError
from crazyflie_utils.parameters import vehicle_model, yaml_file
from crazyflie_utils.parameters.types import FILE
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.text_file import TextFileError, read_text


@pytest.fixture
def home(tmp_path, monkeypatch):
    """Return the home folder, which is the process's folder, too."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_is_found_from_home(home):
    (home / "lab.yaml").write_text("size: 1\nmass: 0.035\n")
    for path in ("~/lab.yaml", "lab.yaml", home / "lab.yaml"):
        assert read_text(path).startswith("size")
        assert yaml_file.load(path)["size"].file.resolve() == home / "lab.yaml"
    (home / "model.yaml").write_text("mass: 0.035\n")
    assert vehicle_model.load("~/model.yaml").mass == 0.035
    assert vehicle_model.load(VEHICLE_MODEL("~/model.yaml")).mass == 0.035


@pytest.mark.parametrize("path", ["~/none.yaml", "none.yaml", "sub/../none.yaml"])
def test_where_a_missing_file_was_looked_for_is_named(home, path):
    with pytest.raises(TextFileError, match=f"No such file.*; looked for {home}/none.yaml$"):
        read_text(path)
    with pytest.raises(ParameterError, match=f"{home}/none.yaml"):
        yaml_file.load(path)


def test_an_absolute_path_is_named_once(home):
    with pytest.raises(ParameterError) as caught:
        yaml_file.load(home / "none.yaml")
    assert str(caught.value) == f"{home}/none.yaml: cannot be read: No such file or directory"


def test_parameters_are_absolute_paths(home):
    for path in ("~/a.yaml", "a.yaml", str(home / "a.yaml")):
        handle = FakeProcess({"/node/file": path}).handle("/node")
        assert handle.get_param("~file", FILE) == os.fspath(home / "a.yaml")


def test_the_home_of_nobody_is_a_folder_s_name(home):
    with pytest.raises(TextFileError, match=f"looked for {home}/~nobody-is-here/x"):
        read_text("~nobody-is-here/x")
