"""The README tells of every option, switch and group."""

import dataclasses
from pathlib import Path

import pytest

from crazyflie_virtual.log_table import log_variables
from crazyflie_virtual.mocap.settings import MocapSettings
from crazyflie_virtual.options import key_of
from crazyflie_virtual.parameter_table import parameter_specs
from crazyflie_virtual.settings import Settings

README = (Path(__file__).parent.parent / "README.md").read_text()


@pytest.mark.parametrize("options", [Settings, MocapSettings])
def test_options(options):
    missing = [key_of(f) for f in dataclasses.fields(options) if f"`{key_of(f)}`" not in README]
    assert missing == []


def test_groups():
    groups = {item.group for item in (*log_variables(), *parameter_specs())}
    assert [group for group in groups if f"`{group}`" not in README] == []


def test_figures():
    assert f"{len(log_variables())} of them" in README
    assert f"{len(parameter_specs())} of them" in README


def test_switches_are_parameters_too():
    names = [f"`virtual.{spec.name}`" for spec in parameter_specs() if spec.group == "virtual"]
    assert [name for name in names if name not in README] == []
