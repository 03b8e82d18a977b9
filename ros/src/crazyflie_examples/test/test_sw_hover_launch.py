"""The software example's launch file, expanded by roslaunch without a master."""

from pathlib import Path

import numpy as np
import pytest
import rospkg
from roslaunch.core import RLException

from crazyflie_lqr.gain_file import load_matrix
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import launch_files

PACKAGES = rospkg.RosPack()
LAUNCH = Path(PACKAGES.get_path("crazyflie_examples")) / "launch"
SW_HOVER = LAUNCH / "sw_hover.launch"
DYNAMICS = ("near_hover", "coupled_7d", "quadrotor")


def expand(**arguments):
    return launch_files.expand(SW_HOVER, rviz="false", **arguments)


@pytest.mark.parametrize("dynamics", DYNAMICS)
def test_executables_and_classes_are_the_same_nodes(dynamics):
    nodes, _ = expand(dynamics=dynamics)
    composed, parameters = expand(dynamics=dynamics, composed="true")
    assert set(composed) == {"/composed", "/robot_base_link_publisher"}
    classes = NODE_CLASSES(launch_files.composed_nodes(parameters))
    assert {f"/{name}" for name in classes} == set(nodes) - {"/robot_base_link_publisher"}
    for name, node_class in classes.items():
        node = nodes[f"/{name}"]
        path = f"{node_class.__module__}:{node_class.__name__}"
        assert launch_files.node_class(node) == path


@pytest.mark.parametrize("estimator_filter", ["finite_difference", "kalman"])
@pytest.mark.parametrize("dynamics", DYNAMICS)
def test_every_node_accepts_its_parameters(dynamics, estimator_filter):
    arguments = {"dynamics": dynamics, "estimator_filter": estimator_filter, "sim_time": "true"}
    assert launch_files.launch(SW_HOVER, **arguments).uses_sim_time


def test_the_estimator_is_told_the_final_control():
    _, parameters = expand(estimator_filter="kalman", final_control_topic="/cf7/control")
    assert parameters["/state_estimator/filter/type"] == "kalman"
    assert parameters["/state_estimator/topics/control"] == "/cf7/control"


@pytest.mark.parametrize(
    ("dynamics", "file"),
    [
        ("near_hover", "K_sim.txt"),
        ("coupled_7d", "K_sim.txt"),
        ("quadrotor", "K_quadrotor.txt"),
    ],
)
def test_gains_go_with_the_model(dynamics, file):
    _, parameters = expand(dynamics=dynamics)
    assert Path(parameters["/lqr_controller/K_file"]).name == file
    assert Path(parameters["/lqr_controller/K_file"]).is_file()


def test_integrator_has_the_signs_of_the_gains():
    _, parameters = expand(dynamics="quadrotor")
    gains = load_matrix(parameters["/lqr_controller/K_file"], 4, 7)
    k = [parameters[f"/lqr_controller/integrator/k/{axis}"] for axis in "xyz"]
    limits = [parameters[f"/lqr_controller/integrator/thresh/{axis}"] for axis in "xyz"]
    assert np.sign(k).tolist() == np.sign([gains[1, 0], gains[0, 1], gains[3, 2]]).tolist()
    assert min(limits) > 0.0


def test_models_of_seven_states_are_flown_without_integrator():
    _, parameters = expand(dynamics="coupled_7d")
    integrator = [value for name, value in parameters.items() if "/integrator/" in name]
    assert integrator == [0.0] * 6


def test_gains_can_be_chosen():
    _, parameters = expand(dynamics="quadrotor", K_file="/my/K.txt", integrator_k_z="-1.5")
    assert parameters["/lqr_controller/K_file"] == "/my/K.txt"
    assert parameters["/lqr_controller/integrator/k/z"] == -1.5
    assert parameters["/lqr_controller/integrator/k/x"] == -0.15


def test_an_unknown_model_is_refused_with_the_choices():
    with pytest.raises(RLException) as error:
        expand(dynamics="helicopter")
    for word in ("helicopter", *DYNAMICS):
        assert word in str(error.value)


def test_vehicles_share_a_process():
    nodes, parameters = expand(composed="true", composed_nodes="/composed/nodes/cf7")
    assert "/composed" not in nodes
    names = launch_files.composed_nodes(parameters)
    assert {name.partition("/")[0] for name in names} == {"cf7"}
    assert "cf7/simulator" in names


@pytest.mark.parametrize("file", ["sw_hover", "sw_controller", "sw_geofence"])
def test_a_node_that_dies_ends_the_launch_or_is_started_again(file):
    nodes, _ = launch_files.expand(LAUNCH / f"{file}.launch", rviz="true")
    required = {name for name, node in nodes.items() if node.required}
    respawning = {name for name, node in nodes.items() if node.respawn}
    assert required == {"/simulator"}
    assert respawning == set(nodes) - required - {"/rviz", "/visualizer"}


def test_the_launch_ends_with_the_one_process():
    nodes, _ = expand(composed="true")
    assert nodes["/composed"].required
