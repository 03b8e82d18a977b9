"""Settings, the programs' command lines, and the README's tables."""

import subprocess
import sys
from pathlib import Path

import pytest
from test_cflib_examples import OTHERS, RUNNING

from crazyflie_utils.parameters.command_line import parse_arguments
from crazyflie_virtual.firmware_parameters import parameter_specs
from crazyflie_virtual.log import log_variables
from crazyflie_virtual.mocap import MocapSettings
from crazyflie_virtual.settings import VehicleSettings, switches


def parse(*arguments, settings_type=VehicleSettings):
    return parse_arguments(settings_type, list(arguments), "program", "text")


def test_defaults_are_those_of_the_class():
    assert parse() == VehicleSettings()
    assert parse(settings_type=MocapSettings) == MocapSettings()


def test_all_types():
    settings = parse(
        "--port", "19855", "--init-x", "-1.5", "--positioning", "none", "--auto-arm", "false",
        "--address", "0x2A", "--fault-motor-failure", "2", "--fault-low-battery", "true",
    )  # fmt: skip
    assert (settings.port, settings.init_x, settings.positioning) == (19855, -1.5, "none")
    assert (settings.auto_arm, settings.address) == (False, 0x2A)
    faults = vars(switches(settings))
    assert {name: value for name, value in faults.items() if value} == {
        "low_battery": True,
        "motor_failure": 2,
    }
    assert {"loss", "delay", "silence", "occluded", "smooth"} < set(faults)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--port", "70000"), "--port is '70000'; expected an integer from 0 to 65535"),
        (("--port", "many"), "--port is 'many'; expected an integer"),
        (("--init-x", "nan"), "--init-x is 'nan'; expected a finite number"),
        (
            ("--positioning", "gps"),
            "--positioning is 'gps'; expected one of deck, flow, lighthouse, loco, none",
        ),
        (("--auto-arm", "1"), "--auto-arm is '1'; expected true or false"),
        (("--wings", "2"), "unrecognized arguments: --wings 2"),
    ],
)
def test_bad_settings_are_named(arguments, text, capsys):
    with pytest.raises(SystemExit) as exit_info:
        parse(*arguments)
    assert exit_info.value.code == 2
    assert text in capsys.readouterr().err


def test_help_names_every_setting(capsys):
    with pytest.raises(SystemExit):
        parse("--help")
    text = capsys.readouterr().out
    for name in ("--observer-rate", "--fault-silence", "--thrust-error"):
        assert name in text


@pytest.mark.parametrize("module", ["crazyflie_virtual", "crazyflie_virtual.mocap"])
def test_programs_need_no_ros(module):
    code = (
        "import runpy, sys\n"
        "sys.modules.update(dict.fromkeys(('rospy', 'rosgraph', 'genpy', 'roslib')))\n"
        "sys.argv[1:] = ['--port=0', '--help']\n"
        f"runpy.run_module('{module}', run_name='__main__')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "usage:" in done.stdout


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
