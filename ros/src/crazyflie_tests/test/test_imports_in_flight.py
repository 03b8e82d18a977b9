"""No process of a flight imports a module after the vehicles are ready to take off."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from crazyflie_utils.testing.programs import free_port

_SCRIPT = Path(__file__).parent / "imports_in_flight.py"


def virtual_hardware():
    # The vehicles have ports one after the other.
    ports = {"virtual_port": 19951, "observer_port": free_port(), "command_port": free_port()}
    arguments = [f"{name}:={port}" for name, port in {**ports, "data_port": free_port()}.items()]
    return ["virtual_hw_swarm.launch", "n:=2", *arguments]


@pytest.mark.parametrize(
    ("launch", "names"),
    [
        (["sw_hover.launch"], ["/"]),
        (["sw_swarm.launch", "n:=2"], ["cf1", "cf2"]),
        (virtual_hardware(), ["cf1", "cf2"]),
    ],
    ids=["sw_hover", "sw_swarm", "virtual_hw_swarm"],
)
def test_nothing_is_imported_in_a_flight(launch, names):
    command = [_SCRIPT, "crazyflie_examples", *launch, "rviz:=false", "--", *names]
    flight = subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, timeout=300, check=False
    )
    assert flight.returncode == 0, flight.stderr[-5000:]
    seen = json.loads(flight.stdout.splitlines()[-1])
    # Otherwise the reports of the imports were not seen at all.
    assert seen["before"] == ["numpy", "rospy"]
    assert seen["in flight"] == []
