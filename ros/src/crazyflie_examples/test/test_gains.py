"""Gains of the launch files that fly: what delay their loops bear as the nodes close them."""

from pathlib import Path

import pytest
import rospkg

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_lqr.margins import flown, loop_margins
from crazyflie_lqr.models import full_state, near_hover
from crazyflie_utils.testing import launch_files

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch"
LEAST_DELAY = 0.06  #: That a loop bears in addition, s.
LEAST_MODULUS = 0.5  #: A disturbance is amplified to twice its size at most.

#: Launch files, with what they fly. The inner loops of the quadrotor, of the virtual and of the
#: real vehicle have a lag.
FLOWN = [
    ("sw_hover", {"dynamics": "near_hover"}, near_hover),
    ("sw_hover", {"dynamics": "coupled_7d"}, near_hover),
    ("sw_hover", {"dynamics": "quadrotor"}, full_state),
    ("sw_controller", {"controller": "position_velocity_yaw"}, near_hover),
    ("sw_controller", {"dynamics": "quadrotor"}, full_state),
    ("sw_geofence", {}, near_hover),
    ("hw_hover", {}, full_state),
    ("virtual_hw_hover", {}, full_state),
    ("hw_swarm", {"fleet": "fleet.yaml"}, full_state),
    ("virtual_hw_swarm", {}, full_state),
]


def gain_files(launch, **arguments):
    """Return the gain files among the parameters of a launch file, by name of the parameter."""
    path = LAUNCH / f"{launch}.launch"
    _, parameters = launch_files.expand(path, **arguments)
    return {name: str(value) for name, value in parameters.items() if name.endswith("/K_file")}


def assert_margins(file, plant):
    states = full_state().states if "full_state" in file else near_hover().states
    loop = flown(load_matrix(file, 4, len(states)), states, plant())
    for each in range(4):
        margins = loop_margins(loop, each)
        assert margins.delay >= LEAST_DELAY
        assert margins.modulus >= LEAST_MODULUS


@pytest.mark.parametrize(("launch", "arguments", "plant"), FLOWN)
def test_gains_bear_a_late_control(launch, arguments, plant):
    files = gain_files(launch, **arguments)
    assert files
    for file in files.values():
        assert_margins(file, plant)


def test_gains_of_a_swarm_bear_a_late_control():
    files = gain_files("sw_swarm")
    assert len(files) == 2
    for name, file in files.items():
        assert_margins(file, full_state if "/models/quadrotor/" in name else near_hover)
