"""Launch files that users have, or include, expand and mean what is documented."""

import contextlib
import functools
import os
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rospkg
import yaml
from pages import PACKAGE_PAGES, PAGES
from roslaunch.core import RLException
from roslaunch.rlutil import resolve_launch_arguments
from roslib.packages import find_node
from workspaces import TOP

from crazyflie_utils.launch_file import unknown_arguments
from crazyflie_utils.testing import launch_files

TEST = Path(__file__).parent
DOCUMENTED = yaml.safe_load((TEST / "launch_files.yaml").read_text())
PACKAGES = rospkg.RosPack()

FILES = {
    "crazyflie_controller": ["config/crazyflie2.yaml", "launch/crazyflie2.launch"],
    "crazyflie_demo": [
        f"launch/{name}.rviz"
        for name in ("crazyflie", "crazyflie_multi", "crazyflie_pos", "crazyflie_pos_multi")
    ],
    "crazyflie_description": [
        "launch/crazyflie.rviz",
        "urdf/crazyflie.urdf.xacro",
        "urdf/crazyflie2.urdf.xacro",
    ],
    "crazyflie_driver": ["launch/crazyflie_add.launch", "launch/crazyflie_server.launch"],
    "crazyflie_lqr": [
        f"references/{name}.txt"
        for name in ("K_lqr", "K_manual", "K_poor", "u_ref_hover", "x_ref_hover", "x_ref_hover_sim")
    ],
    "crazyflie_simulator": ["rviz/crazyflie_simulator.rviz"],
    "xacro": ["xacro", "xacro.py"],
}
"""Files that users' launch files find with ``$(find PACKAGE)/...``."""

RECORDABLE = [
    path
    for path in sorted((TOP / "ros" / "src").glob("**/launch/*.launch"))
    if 'name="record"' in path.read_text()
]


@functools.cache
def path_of(entry):
    """Return the file that roslaunch starts for PACKAGE and FILE; there must be only one."""
    return Path(resolve_launch_arguments(entry.split("/"))[0])


def another(value):
    """Return another value of the same type."""
    if isinstance(value, bool):
        return not value
    return value + 2 if isinstance(value, int | float) else f"{value}7"


def include(tmp_path, entry, arguments):
    """Expand a user's launch file that includes a documented one: unknown arguments are errors."""
    package, file = entry.split("/")
    given = "".join(f'<arg name="{name}" value="{arguments[name]}" />' for name in arguments)
    user = tmp_path / "user.launch"
    user.write_text(
        f'<launch><include file="$(find {package})/launch/{file}">{given}</include></launch>'
    )
    return launch_files.expand(user)


def check_nodes(nodes):
    for name, node in nodes.items():
        assert find_node(node.package, node.type), f"{name}: no {node.type} in {node.package}"
        for word in node.args.split():
            assert not word.startswith("/") or Path(word).exists(), f"{name}: no {word}"


def has(held, expected):
    """Tell whether a parameter is, or contains, what is expected."""
    number = isinstance(expected, int | float)
    return held == expected if number else str(expected) in str(held)


@pytest.mark.parametrize("entry", DOCUMENTED)
def test_defaults(tmp_path, entry):
    arguments = DOCUMENTED[entry]
    required = {name: "given" for name, (default, *_) in arguments.items() if default is None}
    nodes, parameters = include(tmp_path, entry, required)
    assert path_of(entry)
    check_nodes(nodes)
    for name, (default, *places) in arguments.items():
        for place in places:
            assert has(parameters[place], required.get(name, default)), f"{name}: {place}"


@pytest.mark.parametrize("path", RECORDABLE, ids=lambda path: path.name)
def test_what_is_beside_a_flight_is_started_once_if_asked(path):
    given = {
        arg.get("name"): "given"
        for arg in ElementTree.parse(path).getroot().findall("arg")
        if not {"default", "value"} & set(arg.keys())
    }
    optional = {"/recorder": "record", "/dashboard": "dashboard"}
    if path.name == "record.launch":
        del optional["/dashboard"]
    nodes, _ = launch_files.expand(path, **given, **dict.fromkeys(optional.values(), "true"))
    found = [name for name in nodes if name.endswith(("/recorder", "/dashboard"))]
    assert sorted(found) == sorted(optional)


@pytest.mark.parametrize("entry", DOCUMENTED)
def test_every_argument_can_be_given(tmp_path, entry):
    arguments = DOCUMENTED[entry]
    # Bodies are called as the frames are, and nodes stand in their vehicle's namespace.
    given = {name: another(default) for name, (default, *_) in arguments.items()}
    _, parameters = include(tmp_path, entry, given)
    for name, (_, *places) in arguments.items():
        for place in places:
            assert has(held_at(place, parameters), given[name]), f"{name}: {place}"


def held_at(place, parameters):
    """Return a parameter; in a path, the name of the body depends on the frame that is given."""
    pattern = re.sub("rigid_bodies/[^/]+", "rigid_bodies/[^/]+", place)
    (name,) = (name for name in parameters if re.fullmatch(pattern, name))
    return parameters[name]


@pytest.mark.parametrize("entry", [entry for entry in DOCUMENTED if "vrpn" in entry])
def test_the_port_of_vrpn(tmp_path, entry):
    _, parameters = include(tmp_path, entry, {"ip": "10.0.0.3", "port": 3999})
    assert parameters["/mocap_node/motioncapture_config/hostname"] == "10.0.0.3:3999"


@pytest.mark.parametrize(
    ("entry", "argument", "others"),
    [
        ("mocap_optitrack/mocap.launch", "mocap_config_file", {}),
        ("crazyflie_examples/fleet_mocap.launch", "mocap_config_file", {"fleet": "fleet.yaml"}),
        ("crazyflie_driver/crazyflie_add.launch", "genericLogTopicVariables_file", {}),
        ("crazyflie_ranging/ranging.launch", "genericLogTopicVariables_file", {"deck": True}),
        ("crazyflie_ranging/follow_object.launch", "follow_config", {}),
        ("crazyflie_sweep/sweep.launch", "sweep_config", {}),
    ],
)
def test_files_that_roslaunch_loads_are_found_from_home(
    tmp_path, monkeypatch, entry, argument, others
):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "mine.yaml").write_text("mine: 3\n")
    needed = {"uri": "udp://127.0.0.1:19999", "tf_prefix": "cf1"} if "add" in entry else {}
    for file in ("~/mine.yaml", tmp_path / "mine.yaml"):
        _, parameters = launch_files.expand(path_of(entry), **{argument: file, **needed, **others})
        assert [value for name, value in parameters.items() if name.endswith("/mine")] == [3]


def test_the_page_beside_a_flight_takes_its_own_arguments():
    for path in RECORDABLE:
        arguments = ElementTree.parse(path).getroot().findall("arg")
        names = {argument.get("name") for argument in arguments}
        if "dashboard" in names:
            needed = {a.get("name"): "x" for a in arguments if {*a.keys()} == {"name", "doc"}}
            given = {**needed, "dashboard": "true", "folders": "/x", "port": "9"}
            _, parameters = launch_files.expand(path, **given)
            assert parameters["/dashboard/folders"] == "/x", path
            # A port of its own is that of a VRPN server, or of a virtual vehicle.
            assert parameters["/dashboard/port"] == (8642 if "port" in names else 9), path


#: roslaunch with what is given to it, in a page.
COMMAND = re.compile(r"roslaunch (?:-\S+ )*([a-z]\w*) (\w+\.launch)([^\n`|]*)")


@functools.cache
def unknown(*words):
    return unknown_arguments(words)


@pytest.mark.parametrize("page", [*PAGES, *PACKAGE_PAGES], ids=str)
def test_every_argument_in_a_page_reaches_its_launch_file(page, monkeypatch):
    """Also by includes that pass all arguments: roslaunch ignores any other without a word."""
    monkeypatch.setenv("COURSE", str(TOP / "docs" / "course"))
    monkeypatch.setenv("HOME", str(TOP))
    problems = []
    text = page.read_text().replace("\\\n", " ")
    added = re.findall(r'^\+ *<arg name="(\w+)"', text, re.MULTILINE)  # By a recipe.
    for package, file, rest in COMMAND.findall(text):
        given = dict(re.findall(r"(\w+):=([\w.]+)", rest))
        words = [f"{name}:={value}" for name, value in given.items() if name not in added]
        # Packages of a lesson are made there.
        with contextlib.suppress(RLException):
            problems += unknown(package, file, *words)
    assert problems == []


def test_what_a_user_gives_to_the_first_launch_file_reaches_the_last():
    file = path_of("crazyflie_examples/virtual_hw_hover.launch")
    _, parameters = launch_files.expand(file, takeoff_hover_z=0.15, estimator="kalman")
    assert parameters["/takeoff_server/hover/z"] == 0.15
    assert parameters["/crazyflie/crazyflie_add/estimator"] == "kalman"


def test_without_a_display_it_is_said_how_to_launch_without_rviz():
    """Qt's error does not."""
    files = [path for path in TOP.glob("ros/**/launch/**/*.launch") if "test" not in path.parts]
    with_rviz = [path for path in files if 'type="rviz"' in path.read_text()]
    assert len(with_rviz) > 4
    assert all("/on_display.sh" in path.read_text() for path in with_rviz)
    node = launch_files.expand(path_of("crazyflie_examples/sw_hover.launch"))[0]["/rviz"]
    for display, printed in (("", ""), (":9", "shown\n")):
        result = subprocess.run(
            [*node.launch_prefix.split(), "echo", "shown"],
            env={**os.environ, "DISPLAY": display, "WAYLAND_DISPLAY": ""},
            capture_output=True,
            text=True,
            check=True,
        )
        assert result.stdout == printed
        assert ("rviz:=false launches without it" in result.stderr) is not bool(printed)


def test_arguments_without_a_meaning_are_told():
    file = path_of("crazyflie_examples/hw_hover.launch")
    nodes, _ = launch_files.expand(file, rviz="false", sim_init_x="1.0")
    node = nodes["/unused_arguments"]
    program = find_node(node.package, node.type)[0]
    told = subprocess.run(
        [program, *node.args.split(), "__name:=x"],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert "hw_hover.launch" in told.stderr
    assert "sim_init_x" in told.stderr
    assert "__name" not in told.stderr
    assert "/unused_arguments" not in launch_files.expand(file, rviz="false")[0]


def test_every_argument_of_every_launch_file_is_documented():
    """Else `roslaunch --ros-args` prints "undocumented"."""
    files = [path for path in TOP.glob("**/*.launch") if "test" not in path.parts]
    assert len(files) > 50
    missing = [
        f"{path.relative_to(TOP)}: {argument.get('name')}"
        for path in files
        for argument in ElementTree.parse(path).getroot().iter("arg")
        if "value" not in argument.attrib and not argument.get("doc")
    ]
    assert missing == []


@pytest.mark.parametrize("file", ["documented_hover.launch", "documented_hw_hover.launch"])
def test_launch_files_as_users_have_them(file):
    nodes, parameters = launch_files.expand(TEST / file)
    check_nodes(nodes)
    assert "<robot" in parameters["/robot_description"]
    assert "xacro:include" not in parameters["/robot_description"]
    for name in ("K_file", "u_ref_file"):
        assert Path(parameters[f"/lqr_controller/{name}"]).exists()


@pytest.mark.parametrize("package", FILES)
def test_files_that_users_launch_files_find(package):
    for name in FILES[package]:
        assert (Path(PACKAGES.get_path(package)) / name).is_file(), name


@pytest.mark.parametrize("model", ["crazyflie", "crazyflie2"])
@pytest.mark.parametrize("program", ["xacro", "xacro.py"])
def test_xacro_makes_the_models(program, model):
    urdf = Path(PACKAGES.get_path("crazyflie_description")) / "urdf"
    command = [f"{PACKAGES.get_path('xacro')}/{program}", urdf / f"{model}.urdf.xacro"]
    made = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert elements(made) == elements((urdf / f"{model}.urdf").read_text())


def elements(text):
    """Return the elements of a description, as (tag, attributes)."""
    return [(each.tag, each.attrib) for each in ElementTree.fromstring(text).iter()]


def test_xacro_finds_packages(tmp_path):
    file = tmp_path / "found.xacro"
    file.write_text(
        '<robot name="found" xmlns:xacro="http://www.ros.org/wiki/xacro">'
        '<xacro:include filename="$(find crazyflie_description)/urdf/crazyflie.urdf" /></robot>'
    )
    command = ["rosrun", "xacro", "xacro", file]
    made = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    assert 'link name="base_link"' in made


@pytest.mark.parametrize(
    ("place", "is_there"),
    [("theirs/joy", True), ("theirs/other", False), ("own/install/share/joy", False)],
)
def test_stand_ins_give_way(tmp_path, place, is_there):
    # The work of the top-level CMakeLists.txt, in a workspace with one stand-in.
    text = (TOP / "ros" / "src" / "CMakeLists.txt").read_text()
    loop = re.search(r"foreach\(name joy .*?endforeach\(\)", text, re.DOTALL).group()
    stand_in = tmp_path / "own" / "src" / "stand_ins" / "joy"
    real = tmp_path / place
    for folder in (stand_in, real):
        folder.mkdir(parents=True)
        (folder / "package.xml").write_text(
            f"<package><name>{folder.name}</name><version>1.0.0</version><description>x</description>"
            "<maintainer email='x@x.example'>x</maintainer><license>x</license></package>"
        )
    script = tmp_path / "loop.cmake"
    script.write_text(
        f'set(WORKSPACE "{tmp_path}/own")\n' + re.sub(r"name joy .*?\)", "name joy)", loop, count=1)
    )
    path = f"{tmp_path}/own/src:{real.parent}"
    environment = {**os.environ, "ROS_PACKAGE_PATH": path, "ROS_HOME": str(tmp_path)}
    subprocess.run(["cmake", "-P", script], env=environment, timeout=120, check=True)
    assert (stand_in / "CATKIN_IGNORE").exists() == is_there


# Parameters of crazyflie_ros's own launch files, by name, without those that no stand-in reads.
RVIZ = "-d $(find crazyflie_demo)/launch/{}.rviz"
LINK = "0 0 0 0 0 0 1 /vicon/cf/cf /crazyflie/base_link 100"


def element(tag, /, *inner, **attributes):
    text = "".join(f' {key}="{value}"' for key, value in attributes.items())
    return f"<{tag}{text}>{''.join(inner)}</{tag}>"


def included(package, file, **arguments):
    inner = [element("arg", name=name, value=value) for name, value in arguments.items()]
    return element("include", *inner, file=f"$(find {package})/launch/{file}.launch")


def started(package, program, args="", /, **parameters):
    inner = [element("param", name=name, value=value) for name, value in parameters.items()]
    return element(
        "node", *inner, pkg=package, type=program, name=program.replace(".", "_"), args=args
    )


def vehicle(*others, name="crazyflie", logs=False):
    if logs:
        add = started("crazyflie_driver", "crazyflie_add", uri="radio://0/80/2M", tf_prefix=name)
    else:
        given = {"uri": "radio://0/80/2M", "tf_prefix": name, "enable_logging": "False"}
        add = included("crazyflie_driver", "crazyflie_add", **given)
    return element("group", add, *others, ns=name)


def demo(program, /, **parameters):
    return started("crazyflie_demo", program, **parameters)


def rviz(config):
    urdf = "$(find crazyflie_description)/urdf/crazyflie.urdf.xacro"
    xacro = f"$(find xacro)/xacro.py {urdf}"
    model = element("param", name="robot_description", command=xacro)
    return model + started("rviz", "rviz", RVIZ.format(config))


def model(name):
    urdf = f"$(find crazyflie_description)/urdf/{name}.urdf.xacro"
    return (
        element("param", name="robot_description", command=f"$(find xacro)/xacro.py {urdf}"),
        started("joint_state_publisher", "joint_state_publisher"),
        started("robot_state_publisher", "state_publisher"),
        started("rviz", "rviz", "-d $(find crazyflie_description)/launch/crazyflie.rviz"),
    )


SERVER = included("crazyflie_driver", "crazyflie_server")
JOY = started("joy", "joy_node", dev="/dev/input/js0")
TELEOP = demo("controller.py", use_crazyflie_controller="True")
CONTROLLER = included("crazyflie_controller", "crazyflie2", frame="/vicon/cf/cf")
GOAL = demo("publish_pose.py", name="goal", rate=30, x=0, y=0, z=0.5)
MOVED_GOAL = demo("publish_pose_teleop.py", name="goal", rate=10, x=0, y=0, z=0.5)
BASE = started("tf", "static_transform_publisher", LINK)
VICON = included("vicon_bridge", "vicon")
TRACKER = started(
    "ros_vrpn_client",
    "ros_vrpn_client",
    ip="vicon",
    port=3883,
    frame_id="/world",
    child_frame_id="cf",
)
VRPN = started(
    "vrpn_client_ros",
    "vrpn_client_node",
    server="10.0.0.1",
    port=3883,
    frame_id="/world",
    broadcast_tf="false",
)
PLOT = started("rqt_plot", "rqt_plot", "/crazyflie/log1/values[0] /crazyflie/log1/values[1]")
PADS = [included("crazyflie_demo", name) for name in ("ps3", "xbox360")]
HOVER = vehicle(JOY, TELEOP, CONTROLLER, GOAL, BASE)
TWO = [vehicle(TELEOP, CONTROLLER, GOAL, BASE, name=name) for name in ("cf1", "cf2")]
EXTERNAL = "publish_external_{}.py".format

CRAZYFLIE_ROS = {
    "crazyflie_controller/crazyflie2": (
        included("crazyflie_controller", "crazyflie2", frame="cf"),
    ),
    "crazyflie_demo/customLogBlocks": (SERVER, vehicle(logs=True)),
    "crazyflie_demo/external_pose_vicon": (
        SERVER,
        vehicle(demo(EXTERNAL("pose_vicon"), topic="/vicon/cf/cf"), BASE, logs=True),
        VICON,
        rviz("crazyflie_pos"),
        PLOT,
    ),
    "crazyflie_demo/external_position_vicon": (
        SERVER,
        vehicle(demo(EXTERNAL("position_vicon"), topic="/vicon/cf/cf"), BASE, logs=True),
        VICON,
        rviz("crazyflie_pos"),
        PLOT,
    ),
    "crazyflie_demo/external_position_vrpn": (
        SERVER,
        vehicle(demo(EXTERNAL("position_vrpn"), topic="/cf/vrpn_client_node/cf/pose"), VRPN),
    ),
    "crazyflie_demo/hover_vicon": (SERVER, HOVER, VICON, rviz("crazyflie_pos")),
    "crazyflie_demo/hover_vrpn": (SERVER, vehicle(JOY, TELEOP, CONTROLLER, GOAL, BASE, TRACKER)),
    "crazyflie_demo/multi_hover_vicon": (SERVER, JOY, *TWO, VICON, rviz("crazyflie_pos_multi")),
    "crazyflie_demo/multi_hover_vrpn": (
        SERVER,
        JOY,
        *(vehicle(TELEOP, CONTROLLER, TRACKER, name=n) for n in ("cf1", "cf2")),
    ),
    "crazyflie_demo/multi_teleop_ps3": (
        SERVER,
        *(vehicle(JOY, PADS[0], demo("controller.py"), BASE, name=n) for n in ("cf1", "cf2")),
        rviz("crazyflie_multi"),
        PLOT,
    ),
    "crazyflie_demo/multi_teleop_xbox360": (
        SERVER,
        *(vehicle(JOY, PADS[1], demo("controller.py"), BASE, name=n) for n in ("cf1", "cf2")),
        rviz("crazyflie_multi"),
        PLOT,
    ),
    "crazyflie_demo/multi_waypoint_vicon": (
        SERVER,
        JOY,
        *(
            vehicle(TELEOP, CONTROLLER, demo(f"demo{k}.py", frame="cf"), name=f"cf{k}")
            for k in (1, 2)
        ),
        VICON,
    ),
    "crazyflie_demo/position": (SERVER, vehicle(demo("Position.py"))),
    "crazyflie_demo/ps3": (demo("quadrotor_teleop", x_axis=4, y_axis=3, z_axis=2, yaw_axis=1),),
    "crazyflie_demo/swarm_external_position_vrpn": (
        SERVER,
        *(
            vehicle(demo(EXTERNAL("position_vrpn"), topic="pose"), VRPN, name=f"cf{k}", logs=True)
            for k in (1, 2, 3)
        ),
    ),
    "crazyflie_demo/teleop_ps3": (SERVER, vehicle(JOY, PADS[0], demo("controller.py"))),
    "crazyflie_demo/teleop_vicon": (
        SERVER,
        vehicle(JOY, TELEOP, CONTROLLER, MOVED_GOAL, BASE),
        VICON,
        rviz("crazyflie_pos"),
    ),
    "crazyflie_demo/teleop_xbox360": (SERVER, vehicle(JOY, PADS[1], demo("controller.py"))),
    "crazyflie_demo/test_high_level": (SERVER, vehicle(demo("test_high_level.py"))),
    "crazyflie_demo/xbox360": (demo("quadrotor_teleop", x_axis=4, y_axis=3, z_axis=2, yaw_axis=1),),
    "crazyflie_description/crazyflie2_rviz": model("crazyflie2"),
    "crazyflie_description/crazyflie_rviz": model("crazyflie"),
    "crazyflie_driver/crazyflie_add": (vehicle(),),
    "crazyflie_driver/crazyflie_server": (SERVER,),
}


@pytest.mark.parametrize("name", CRAZYFLIE_ROS)
def test_launch_files_of_crazyflie_ros_start_as_they_are(tmp_path, name):
    assert len(CRAZYFLIE_ROS) == 24
    file = tmp_path / "theirs.launch"
    file.write_text(element("launch", *CRAZYFLIE_ROS[name]))
    nodes, _ = launch_files.expand(file)
    assert nodes
    for full_name, node in nodes.items():
        assert find_node(node.package, node.type), f"{full_name}: {node.package}/{node.type}"
        assert all(Path(word).is_file() for word in node.args.split() if word.endswith(".rviz"))


def test_rqt_plot_says_where_plots_are():
    command = ["rosrun", "rqt_plot", "rqt_plot", "/cf1/log1/values[0]", "__name:=rqt_plot1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "dashboard.launch, then Plots, and add /cf1/log1/values[0]\n" in done.stdout
