"""Launch files that users have, or include, expand and mean what is documented."""

import functools
import os
import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rospkg
import yaml
from roslaunch.rlutil import resolve_launch_arguments
from roslib.packages import find_node
from workspaces import TOP

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
"""What users' launch files find with ``$(find PACKAGE)/...``."""

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
    beside = {"/recorder": "record", "/dashboard": "dashboard"}
    if path.name == "record.launch":
        del beside["/dashboard"]
    nodes, _ = launch_files.expand(path, **given, **dict.fromkeys(beside.values(), "true"))
    found = [name for name in nodes if name.endswith(("/recorder", "/dashboard"))]
    assert sorted(found) == sorted(beside)


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
    # What the top-level CMakeLists.txt does, in a workspace with one stand-in.
    text = (TOP / "ros" / "src" / "CMakeLists.txt").read_text()
    loop = re.search(r"foreach\(name joy xacro\).*?endforeach\(\)", text, re.DOTALL).group()
    stand_in = tmp_path / "own" / "src" / "stand_ins" / "joy"
    real = tmp_path / place
    for folder in (stand_in, real):
        folder.mkdir(parents=True)
        (folder / "package.xml").write_text(
            f"<package><name>{folder.name}</name><version>1.0.0</version><description>x</description>"
            "<maintainer email='x@x.example'>x</maintainer><license>x</license></package>"
        )
    script = tmp_path / "loop.cmake"
    script.write_text(f'set(WORKSPACE "{tmp_path}/own")\n' + loop.replace("joy xacro", "joy"))
    path = f"{tmp_path}/own/src:{real.parent}"
    environment = {**os.environ, "ROS_PACKAGE_PATH": path, "ROS_HOME": str(tmp_path)}
    subprocess.run(["cmake", "-P", script], env=environment, timeout=120, check=True)
    assert (stand_in / "CATKIN_IGNORE").exists() == is_there
