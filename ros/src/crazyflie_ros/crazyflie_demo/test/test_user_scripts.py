"""What users' scripts import, from wherever they lie."""

import inspect
import subprocess
import sys

import pytest
from crazyflie import Crazyflie

SIGNATURES = {
    "setGroupMask": "groupMask",
    "takeoff": "targetHeight, duration, groupMask=0",
    "land": "targetHeight, duration, groupMask=0",
    "stop": "groupMask=0",
    "goTo": "goal, yaw, duration, relative=False, groupMask=0",
    "uploadTrajectory": "trajectoryId, pieceOffset, trajectory",
    "startTrajectory": "trajectoryId, timescale=1.0, reverse=False, relative=True, groupMask=0",
    "position": "",
    "getParam": "name",
    "setParam": "name, value",
    "setParams": "params",
}


def arguments(function):
    """Return the arguments of a method as it was called, without their types."""
    signature = inspect.signature(function)
    bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
    return ", ".join(str(each) for each in bare[1:])


@pytest.mark.parametrize("name", SIGNATURES)
def test_methods_take_what_scripts_give(name):
    assert arguments(getattr(Crazyflie, name)) == SIGNATURES[name]


def test_a_vehicle_has_a_prefix_and_a_frame():
    assert arguments(Crazyflie.__init__) == "prefix, tf"


def test_a_script_far_away_imports_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import crazyflie\n"
        "import uav_trajectory\n"
        "from crazyflie import Crazyflie\n"
        "from uav_trajectory import Polynomial, Polynomial4D, Trajectory, TrajectoryOutput\n"
        "assert crazyflie.Crazyflie is Crazyflie\n"
        "assert uav_trajectory.Trajectory is Trajectory\n"
    )
    subprocess.run([sys.executable, script], cwd=tmp_path, check=True, timeout=60)
