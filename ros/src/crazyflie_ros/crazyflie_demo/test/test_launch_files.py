"""The launch files, expanded by roslaunch without a master; every node takes its parameters."""

import functools
from pathlib import Path

import pytest

from crazyflie_demo.flight_plan_nodes import TrajectoryFlightNode
from crazyflie_utils.program import load
from crazyflie_utils.testing import FakeProcess, launch_files
from mocap_optitrack.mocap_node import MocapNode

PACKAGE = Path(__file__).parents[1]
LAUNCH_FILES = sorted((PACKAGE / "launch").glob("*.launch"))
OWN = ("crazyflie_controller", "crazyflie_demo", "crazyflie_driver")

DRIVER = {"/crazyflie_server": "crazyflie_server"}
ONE = {**DRIVER, "/crazyflie/crazyflie_add": "crazyflie_add"}
JOYSTICK = {"joy": "joy_node"}


@functools.cache
def expand(file, **arguments):
    """Return nodes and values of parameters, by full name."""
    return launch_files.expand(PACKAGE / "launch" / file, **arguments)


def types(nodes):
    return {name: node.type for name, node in nodes.items()}


def controlled(prefix, goal_type):
    """Return what is expected for a vehicle with a controller."""
    return {
        f"/{prefix}/baselink_broadcaster": "static_transform_publisher",
        f"/{prefix}/crazyflie_add": "crazyflie_add",
        f"/{prefix}/controller": "crazyflie_controller",
        f"/{prefix}/joystick_controller": "controller.py",
        f"/{prefix}/pose": goal_type,
    }


@pytest.mark.parametrize("pad", ["xbox360", "ps3"])
def test_teleop(pad):
    nodes, parameters = expand(f"teleop_{pad}.launch", uri="udp://127.0.0.1:1", joy_dev="/dev/js7")
    assert types(nodes) == {
        **ONE,
        "/crazyflie/joy": "joy_node",
        "/crazyflie/joystick_controller": "controller.py",
        "/crazyflie/teleop": "teleop.py",
    }
    assert parameters["/crazyflie/joy/dev"] == "/dev/js7"
    assert parameters["/crazyflie/crazyflie_add/uri"] == "udp://127.0.0.1:1"


@pytest.mark.parametrize("system", ["mocap", "vicon", "vrpn"])
def test_hover(system):
    nodes, parameters = expand(f"hover_{system}.launch", z=0.8, mocap="true")
    assert types(nodes) == {
        **DRIVER,
        **controlled("crazyflie", "publish_pose.py"),
        "/crazyflie/joy": "joy_node",
        "/mocap_node": "mocap_node",
    }
    assert parameters["/crazyflie/pose/z"] == 0.8


@pytest.mark.parametrize("system", ["mocap", "vicon", "vrpn"])
@pytest.mark.parametrize(
    ("what", "goals"),
    [
        ("hover", ("publish_pose.py", "publish_pose.py")),
        ("waypoint", ("demo1.py", "demo2.py")),
    ],
)
def test_two_vehicles(system, what, goals):
    nodes, parameters = expand(f"multi_{what}_{system}.launch", mocap="true")
    assert types(nodes) == {
        **DRIVER,
        **controlled("crazyflie1", goals[0]),
        **controlled("crazyflie2", goals[1]),
        "/joy": "joy_node",
        "/mocap_node": "mocap_node",
    }
    uris = [parameters[f"/crazyflie{i}/crazyflie_add/uri"] for i in (1, 2)]
    assert len(set(uris)) == 2


@pytest.mark.parametrize("pad", ["xbox360", "ps3"])
def test_two_joysticks(pad):
    nodes, parameters = expand(f"multi_teleop_{pad}.launch")
    assert list(types(nodes).values()).count("teleop.py") == 2
    assert parameters["/crazyflie1/joy/dev"] != parameters["/crazyflie2/joy/dev"]


def motion_capture_files():
    return [
        path.name
        for path in LAUNCH_FILES
        if path.stem.endswith(("_mocap", "_vicon", "_vrpn")) and "external" not in path.name
    ]


@pytest.mark.parametrize("file", motion_capture_files())
def test_motion_capture_publishes_the_frames_that_are_flown_by(file):
    _, parameters = expand(file, mocap="true")
    published = {value for name, value in parameters.items() if name.endswith("child_frame_id")}
    flown = {value for name, value in parameters.items() if name.endswith("/controller/frame")}
    assert flown
    assert flown <= published


@pytest.mark.parametrize("file", motion_capture_files())
def test_joystick_and_motion_capture_can_be_left_out(file):
    nodes, _ = expand(file, joy="false", mocap="false")
    assert not {"joy_node", "mocap_node"} & set(types(nodes).values())


@pytest.mark.parametrize("system", ["vicon", "vrpn"])
def test_bodies_have_the_names_that_the_server_knows(system):
    _, parameters = expand(f"hover_{system}.launch", frame="/vicon/cf9/cf9")
    assert parameters["/mocap_node/rigid_bodies/cf9/child_frame_id"] == "/vicon/cf9/cf9"


def test_a_configuration_of_ones_own_holds_all_bodies(tmp_path):
    config = tmp_path / "mocap.yaml"
    config.write_text("rigid_bodies: {'5': {child_frame_id: HY5/base_link}}")
    _, parameters = expand("hover_mocap.launch", mocap="true", mocap_config_file=str(config))
    bodies = tree(parameters, "/mocap_node/rigid_bodies/")
    assert bodies == {"5": {"child_frame_id": "HY5/base_link"}}


@pytest.mark.parametrize("mocap", ["true", "false"])
@pytest.mark.parametrize("what", ["pose", "position"])
def test_external_poses_reach_the_driver(what, mocap):
    nodes, parameters = expand(f"external_{what}_vicon.launch", mocap=mocap)
    published = parameters["/mocap_node/rigid_bodies/cf/pose"]
    if mocap == "false":
        assert nodes["/crazyflie/pose"].type == f"publish_external_{what}_vicon.py"
        assert parameters["/crazyflie/pose/topic"] == "/vicon/cf/cf"
    elif what == "position":
        assert nodes["/crazyflie/pose"].type == "publish_external_position_vrpn.py"
        assert parameters["/crazyflie/pose/topic"] == published
    else:
        assert published == "/crazyflie/external_pose"
        assert "/crazyflie/pose" not in nodes


@pytest.mark.parametrize("file", ["hover_mocap.launch", "multi_hover_vrpn.launch"])
def test_rviz_on_request(file):
    nodes, parameters = expand(file, rviz="true")
    assert Path(nodes["/rviz"].args.split()[1]).exists()
    assert "<robot" in parameters["/robot_description"]


@pytest.mark.parametrize(
    ("file", "argument"), [("hover_vicon.launch", "hostname"), ("multi_waypoint_vrpn.launch", "ip")]
)
def test_the_server_of_motion_capture(file, argument):
    _, parameters = expand(file, **{argument: "10.0.0.3"})
    assert parameters["/mocap_node/motioncapture_config/hostname"] == "10.0.0.3"
    assert parameters["/mocap_node/backend"] in ("vicon", "vrpn")


def test_buttons_call_the_controller_and_not_the_driver():
    nodes, _ = expand("multi_hover_mocap.launch")
    for prefix in ("/crazyflie1", "/crazyflie2"):
        for name in ("controller", "joystick_controller"):
            assert sorted(map(list, nodes[f"{prefix}/{name}"].remap_args)) == [
                ["land", "controller/land"],
                ["takeoff", "controller/takeoff"],
            ]


def test_custom_log_blocks():
    nodes, parameters = expand("customLogBlocks.launch")
    assert types(nodes) == {**DRIVER, "/crazyflie_add": "crazyflie_add"}
    prefix = "/crazyflie_add"
    topics = parameters[f"{prefix}/genericLogTopics"]
    assert len(parameters[f"{prefix}/genericLogTopicFrequencies"]) == len(topics)
    for topic in topics:
        assert parameters[f"{prefix}/genericLogTopic_{topic}_Variables"]


@pytest.mark.parametrize("name", ["test_high_level", "execute_trajectory"])
def test_high_level_flights(name):
    nodes, parameters = expand(f"{name}.launch")
    assert types(nodes) == {**ONE, f"/crazyflie/{name}": f"{name}.py"}
    # A hover by the planner has no end of its own.
    assert parameters["/crazyflie_server/emergency_watchdog"] is True


@pytest.mark.parametrize(
    "name",
    [
        "test_high_level",
        "execute_trajectory",
        "position",
        "hover",
        "external_pose_vicon",
        "external_position_vicon",
        "external_position_vrpn",
        "swarm_external_position_vrpn",
    ],
)
def test_launch_files_whose_vehicle_flies_by_its_own_position_set_the_filter(name):
    nodes, parameters = expand(f"{name}.launch")
    added = [each for each, node in nodes.items() if node.type == "crazyflie_add"]
    assert added
    assert {parameters[f"{each}/estimator"] for each in added} == {"kalman"}


def tree(parameters, prefix):
    """Return the parameters below a name as the parameter server does."""
    root = {}
    for name, value in parameters.items():
        if name.startswith(prefix):
            *branches, leaf = name.removeprefix(prefix).split("/")
            branch = root
            for key in branches:
                branch = branch.setdefault(key, {})
            branch[leaf] = value
    return root


def node_class(node):
    """Return the class that an executable runs."""
    if node.type == "execute_trajectory.py":
        return TrajectoryFlightNode
    return load(launch_files.node_class(node))


@pytest.mark.parametrize("file", [path.name for path in LAUNCH_FILES])
def test_every_node_accepts_its_parameters(file):
    nodes, parameters = expand(file)
    for name, node in nodes.items():
        if node.type == "Hover.py":
            # Plain rospy, as scripts of users are: its arguments are all that it reads.
            assert node.args.split() == ["cf1", "cf2"]
        elif node.package in OWN:
            # Each for itself, as in a process of its own.
            process = FakeProcess(parameters)
            assert process.launch(node_class(node)(), name), process.logged("error")
        elif node.type == "mocap_node":
            bodies = tree(parameters, f"{name}/rigid_bodies/")
            process = FakeProcess({**parameters, f"{name}/rigid_bodies": bodies})
            MocapNode().load_parameters(process.handle(name))
