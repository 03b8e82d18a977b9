"""The hardware example's launch files, expanded by roslaunch without a master."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import rospkg

from crazyflie_utils.testing import launch_files

LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_examples")) / "launch"

# Arguments that users' launch files may set, with the defaults on which they rely; None for a path,
# or for a tuning value.
ARGUMENTS = {
    "reference_topic": "/ref",
    "state_topic": "/state",
    "lqr_control_topic": "/control/lqr",
    "takeoff_control_topic": "/control/takeoff",
    "final_control_topic": "/control/final",
    "in_flight_topic": "/in_flight",
    "fixed_frame": "world",
    "robot_frame": "crazyflie",
    "takeoff_hover_x": 0.0,
    "takeoff_hover_y": 0.0,
    "takeoff_hover_z": 1.0,
    "K_file": None,
    "u_ref_file": None,
    "estimator_dt": 0.01,
    "x_dim": 7,
    "u_dim": 4,
    "uri": "$(arg HY5)",
    "mocap_frame": "HY5/base_link",
    "joy_dev": "/dev/input/js0",
}


def test_arguments_of_hw_hover():
    root = ElementTree.parse(LAUNCH / "hw_hover.launch").getroot()
    defaults = {entry.get("name"): entry.get("default") for entry in root.findall("arg")}
    for name, expected in ARGUMENTS.items():
        assert defaults[name] is not None
        if expected is not None:
            assert type(expected)(defaults[name]) == expected


@pytest.mark.parametrize("composed", ["true", "false"])
def test_names_of_one_vehicle_reach_all_nodes(composed):
    _, parameters = launch_files.expand(
        LAUNCH / "hw_hover.launch",
        rviz="false",
        composed=composed,
        uri="udp://127.0.0.1:19999",
        robot_frame="cf3",
        final_control_topic="/control/cf3",
    )
    added = "/crazyflie/crazyflie_add"
    assert parameters[f"{added}/uri"] == "udp://127.0.0.1:19999"
    assert parameters[f"{added}/tf_prefix"] == "cf3"
    assert parameters["/cmd_vel_converter/topics/cmd_vel"] == "/cf3/cmd_vel"
    assert parameters["/cmd_vel_converter/topics/control"] == "/control/cf3"
    assert parameters["/state_estimator/frames/robot"] == "cf3"
    for node in ("takeoff_server", "takeoff_control_filter"):
        assert parameters[f"/{node}/topics/connected"] == "/cf3/connected"


def test_what_dies_in_flight_is_started_again():
    nodes, parameters = launch_files.expand(LAUNCH / "hw_hover.launch", rviz="false")
    # A driver that is started again knows no vehicle, and crazyflie_add ends when it has added one.
    once = {name for name, node in nodes.items() if not node.respawn}
    assert once == {"/crazyflie_server", "/crazyflie/crazyflie_add"}
    # The vehicle stops its motors if the driver does not come back.
    assert parameters["/crazyflie_server/emergency_watchdog"] is True
    simulated, _ = launch_files.expand(LAUNCH / "sw_geofence.launch", rviz="false")
    assert {name for name, node in simulated.items() if not node.respawn} == {"/simulator"}


def test_what_keeps_the_motors_running_is_started_again_at_once():
    nodes, _ = launch_files.expand(LAUNCH / "hw_hover.launch", rviz="false")
    for name in ("/takeoff_control_filter", "/cmd_vel_converter"):
        assert (nodes[name].respawn, nodes[name].respawn_delay) == (True, 0.0)


def test_the_frame_of_motion_capture_outlives_its_publisher():
    # Messages of tf2's publisher are latched and kept; tf's publisher would have to repeat them.
    nodes, _ = launch_files.expand(LAUNCH / "hw_hover.launch", rviz="false")
    assert nodes["/mocap_robot_publisher"].package == "tf2_ros"


@pytest.mark.parametrize("node", ["takeoff_server", "takeoff_control_filter"])
def test_takeoff_servers_and_filters_ask_for_the_driver_where_one_flies(node):
    of_driver = f"{node}/topics/connected"
    _, simulated = launch_files.expand(LAUNCH / "sw_hover.launch", rviz="false")
    assert f"/{of_driver}" not in simulated
    _, swarm = launch_files.expand(LAUNCH / "virtual_hw_swarm.launch", rviz="false")
    assert swarm[f"/fleet/nodes/{of_driver}"] == "connected"
    _, simulated_swarm = launch_files.expand(LAUNCH / "sw_swarm.launch", rviz="false")
    assert f"/fleet/nodes/{of_driver}" not in simulated_swarm


def test_the_virtual_pair_meets_on_the_ports_that_are_given():
    _, parameters = launch_files.expand(
        LAUNCH / "virtual_hw_hover.launch",
        rviz="false",
        port=19999,
        observer_port=19998,
        command_port=15299,
        data_port=15298,
    )
    assert parameters["/virtual_crazyflie/port"] == 19999
    for node in ("virtual_crazyflie", "virtual_mocap"):
        assert parameters[f"/{node}/observer/port"] == 19998
    settings = "/mocap_node/optitrack_config"
    assert parameters["/virtual_mocap/command_port"] == 15299
    assert parameters[f"{settings}/command_port"] == 15299
    assert parameters[f"{settings}/data_port"] == 15298


def test_arguments_of_hw_hover_can_be_given_to_the_virtual_one():
    _, parameters = launch_files.expand(
        LAUNCH / "virtual_hw_hover.launch",
        rviz="false",
        port=19999,
        takeoff_hover_z=0.5,
        fixed_frame="lab",
        mocap_frame="cf7/body",
        robot_frame="cf7",
    )
    assert parameters["/crazyflie/crazyflie_add/uri"] == "udp://127.0.0.1:19999"
    assert parameters["/takeoff_server/hover/z"] == 0.5
    body = "/mocap_node/rigid_bodies/cf7"
    assert parameters[f"{body}/parent_frame_id"] == parameters["/state_estimator/frames/fixed"]
    assert parameters[f"{body}/child_frame_id"] == "cf7/body"
