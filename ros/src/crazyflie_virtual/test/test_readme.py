"""The README names every group, and every switch as a CRTP parameter."""

from pathlib import Path

from test_cflib_examples import OTHERS, RUNNING

from crazyflie_virtual.log import log_variables
from crazyflie_virtual.parameters import parameter_specs

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_groups():
    groups = {item.group for item in (*log_variables(), *parameter_specs())}
    assert [group for group in groups if f"`{group}`" not in README] == []


def test_figures():
    assert f"{len(log_variables())} of them" in README
    assert f"{len(parameter_specs())} of them" in README


def test_switches_are_parameters_too():
    names = [f"`virtual.{spec.name}`" for spec in parameter_specs() if spec.group == "virtual"]
    assert [name for name in names if name not in README] == []


def test_examples():
    names = (*RUNNING, *OTHERS)
    assert [name for name in names if f"`{name}`" not in README] == []
