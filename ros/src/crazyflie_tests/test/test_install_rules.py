"""Files that ``catkin_make install`` would install: everything for users, no developer's tools.

This reads what CMake has written for the built workspace; test_install_space.py installs a copy.
"""

import os
import re
import runpy
from pathlib import Path

import pytest
import setuptools
from workspaces import INSTALLED, TOP, code_of, data_of, programs_of

from crazyflie_utils.program import load

ROS = TOP / "ros"
RULE = re.compile(
    r'file\(INSTALL DESTINATION "\$\{CMAKE_INSTALL_PREFIX\}/([^"]*)" TYPE (\w+)'
    r' FILES((?:\s+"[^"]*")+)'
)


def build_folder(package):
    """Return the folder of a package in the build space."""
    return ROS / "build" / INSTALLED[package].relative_to(ROS / "src")


def rules_of(package):
    """Return what is installed of a package: path in the install space -> kind and source."""
    found = {}
    text = (build_folder(package) / "cmake_install.cmake").read_text()
    for destination, kind, sources in RULE.findall(text):
        for source in map(Path, re.findall('"([^"]*)"', sources)):
            place = Path(destination) / source.name
            found[place] = kind, source
            for file in source.rglob("*") if kind == "DIRECTORY" else ():
                found[place / file.relative_to(source)] = "FILE", file
    return found


@pytest.mark.parametrize("package", INSTALLED)
def test_programs_and_data_are_installed(package):
    rules = rules_of(package)
    built = {name: ROS / "devel" / "lib" / package / name for name in programs_of(package)}
    for source in (*INSTALLED[package].glob("exec/*"), *built.values()):
        assert os.access(source, os.X_OK)
        kind, program = rules[Path("lib", package, source.name)]
        assert kind == "PROGRAM"
        # catkin chooses the interpreter.
        assert code_of(program) == code_of(source)
    for name, source in data_of(package):
        _, file = rules[Path("share", package, name)]
        assert file.read_bytes() == source.read_bytes()


@pytest.mark.parametrize("package", [name for name in INSTALLED if programs_of(name)])
def test_programs_call_what_exists(package):
    for name, path in programs_of(package).items():
        assert callable(load(path)), f"{name} calls {path}"


@pytest.mark.parametrize("package", INSTALLED)
def test_modules_are_installed(package, monkeypatch):
    top = INSTALLED[package] / "src"
    modules = {".".join(file.parent.relative_to(top).parts) for file in top.rglob("*.py")}
    rules = (build_folder(package) / "cmake_install.cmake").read_text()
    assert ("safe_execute_install.cmake" in rules) == bool(modules)
    if not modules:
        return
    asked = {}
    monkeypatch.setattr(setuptools, "setup", lambda **words: asked.update(words))
    monkeypatch.chdir(top.parent)
    runpy.run_path("setup.py")
    assert set(asked["packages"]) == modules


def test_tools_of_developers_are_not_installed():
    text = (ROS / "build" / "cmake_install.cmake").read_text()
    assert "/crazyflie_utils/cmake_install.cmake" in text
    assert "/crazyflie_dev/" not in text
