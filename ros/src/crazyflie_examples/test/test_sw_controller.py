"""The software example with other controllers: its launch file, and the reference converter."""

from pathlib import Path

import pytest
import rospkg
from roslaunch.core import RLException

from crazyflie_examples.reference_converter_node import ReferenceConverterNode
from crazyflie_lqr.lqr_nodes import (
    FullStateLqrNode,
    PositionVelocityYawStateLiftLqrNode,
    PositionVelocityYawStateLqrNode,
)
from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files
from crazyflie_utils.vectors import to_vector

PACKAGES = rospkg.RosPack()
LAUNCH = Path(PACKAGES.get_path("crazyflie_examples")) / "launch" / "sw_controller.launch"
CLASSES = {
    "lift": PositionVelocityYawStateLiftLqrNode,
    "position_velocity_yaw": PositionVelocityYawStateLqrNode,
    "full_state": FullStateLqrNode,
}
PARAMETERS = {
    "topics/reference": "/ref",
    "topics/converted": "/ref/converted",
    "state": "full_state",
}


def expand(**arguments):
    return launch_files.expand(LAUNCH, rviz="false", **arguments)


def launch_all(parameters):
    """Return a process with all nodes that the parameters list."""
    process = FakeProcess(parameters)
    for name, node_class in NODE_CLASSES(launch_files.composed_nodes(parameters)).items():
        assert process.launch(node_class(), f"/{name}"), process.logged("error")
    return process


@pytest.mark.parametrize("dynamics", ["near_hover", "quadrotor"])
@pytest.mark.parametrize("controller", CLASSES)
def test_controller_is_the_one_asked_for(controller, dynamics):
    nodes, _ = expand(controller=controller, dynamics=dynamics)
    composed, parameters = expand(
        controller=controller, dynamics=dynamics, composed="true", sim_time="true"
    )
    classes = NODE_CLASSES(launch_files.composed_nodes(parameters))
    assert classes["lqr_controller"] is CLASSES[controller]
    assert {f"/{name}" for name in classes} == set(nodes) - {"/robot_base_link_publisher"}
    for name, node_class in classes.items():
        node = nodes[f"/{name}"]
        path = f"{node_class.__module__}:{node_class.__name__}"
        assert launch_files.node_class(node) == path


@pytest.mark.parametrize("controller", CLASSES)
def test_a_reference_of_the_takeoff_server_reaches_the_controller(controller):
    _, parameters = expand(
        controller=controller, reference_topic="/cf7/ref", composed="true", sim_time="true"
    )
    process = launch_all(parameters)
    topic = parameters["/lqr_controller/topics/reference"]
    assert (topic == "/cf7/ref") == (controller == "lift")
    if controller != "lift":
        state = PositionVelocityState(x=1.0, y=2.0, z=3.0)
        process.publish("/cf7/ref", PositionVelocityStateStamped(state=state))
        [reference] = process.published(topic)
        assert (reference.state.x, reference.state.y, reference.state.z) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("controller", "dynamics", "file"),
    [
        ("lift", "near_hover", "K_sim.txt"),
        ("position_velocity_yaw", "quadrotor", "K_quadrotor.txt"),
        ("full_state", "near_hover", "K_full_state.txt"),
        ("full_state", "quadrotor", "K_full_state.txt"),
    ],
)
def test_gains_go_with_the_controller(controller, dynamics, file):
    _, parameters = expand(controller=controller, dynamics=dynamics)
    assert Path(parameters["/lqr_controller/K_file"]).name == file


@pytest.mark.parametrize("controller", CLASSES)
def test_gains_can_be_chosen(controller):
    _, parameters = expand(controller=controller, K_file="/my/K.txt")
    assert parameters["/lqr_controller/K_file"] == "/my/K.txt"


def test_an_unknown_controller_is_refused_with_the_choices():
    with pytest.raises(RLException) as error:
        expand(controller="pid")
    for word in ("pid", *CLASSES):
        assert word in str(error.value)


@pytest.mark.parametrize("suffix", ["", "_descent"])
@pytest.mark.parametrize(("state", "size"), [("position_velocity_yaw", 7), ("full_state", 12)])
def test_converts_what_is_there_and_leaves_the_rest_zero(state, size, suffix):
    process = FakeProcess()
    parameters = {**PARAMETERS, "state": state}
    assert process.launch(ReferenceConverterNode(), "/reference_converter", parameters)
    reference = PositionVelocityStateStamped(
        state=PositionVelocityState(1.0, 2.0, 3.0, 0.1, 0.2, 0.3)
    )
    reference.header.stamp = process.clock.stamp(7.5)
    process.publish(f"/ref{suffix}", reference)
    [converted] = process.published(f"/ref/converted{suffix}")
    assert to_vector(converted.state).tolist() == [1.0, 2.0, 3.0, 0.1, 0.2, 0.3] + [0.0] * (
        size - 6
    )
    assert converted.header.stamp == reference.header.stamp


@pytest.mark.parametrize("name", PARAMETERS)
def test_parameters_of_the_converter_are_required(name):
    fake = FakeProcess()
    parameters = {key: value for key, value in PARAMETERS.items() if key != name}
    assert not fake.launch(ReferenceConverterNode(), "/reference_converter", parameters)
    assert f"/reference_converter/{name} is not set" in fake.logged("error")[0]


def test_an_unknown_state_is_named():
    fake = FakeProcess()
    parameters = {**PARAMETERS, "state": "position"}
    assert not fake.launch(ReferenceConverterNode(), "/reference_converter", parameters)
    [error] = fake.logged("error")
    assert "/reference_converter/state is 'position'; expected one of" in error
    assert "full_state" in error
