"""The checks of the doctor, on data: what is found, and that what is well is left alone."""

import dataclasses
import os
import socket

import pytest

from crazyflie_lqr.models import near_hover
from crazyflie_tools.doctor import graph, installation, look, motion
from crazyflie_tools.doctor.finding import Check, error, lines, warn
from crazyflie_tools.doctor.graph import Graph
from crazyflie_tools.doctor.installation import Network, Python, Radio
from crazyflie_tools.doctor.motion import Heard, Transform

CONTROL = ("crazyflie_msgs/ControlStamped", "e85f24c467a6496a2e0c3b92ff0fe75d")
REFERENCE = ("crazyflie_msgs/PositionVelocityStateStamped", "d7e2e75df27e542774773e0a516e76ff")

SOFT = "0 .25 0 0 1 0 0\n-.25 0 0 -1 0 0 0\n0 0 0 0 0 0 -3.5\n0 0 -1.5 0 0 -1 0\n"


def found(findings):
    """Return level and text of all findings; each says what to do."""
    findings = list(findings)
    assert all(finding.remedy for finding in findings)
    return [(finding.level, finding.text) for finding in findings]


def the_only(findings):
    [(level, text)] = found(findings)
    return level, text


def test_a_line_for_each_finding_or_one_that_says_what_is_fine():
    assert list(lines(Check("logs", "much space", list))) == [("ok", "ok     logs: much space")]
    both = lines(Check("logs", "", lambda: [warn("little space", "free some"), error("a", "b")]))
    assert list(both) == [
        ("warn", "warn   logs: little space; free some"),
        ("error", "error  logs: a; b"),
    ]


# Installation.


@pytest.mark.parametrize(
    ("python", "part"),
    [
        (Python("/opt/conda/bin/python3", "3.12", {}), "is Python 3.12, ROS is installed for 3.11"),
        (Python("", "", {}), "no python3 on the PATH"),
        (Python("/usr/bin/python3", "3.11", {"cflib": "none"}), "cannot import cflib (none)"),
    ],
)
def test_a_wrong_python(python, part):
    level, text = the_only(installation.check_python(python, "3.11"))
    assert level == "error"
    assert part in text


def test_the_right_python():
    assert not found(installation.check_python(Python("/usr/bin/python3", "3.11", {}), "3.11"))


def test_packages():
    wanted = {"cflib": "0.1.34", "numpy": "", "rviz": ""}
    installed = {"cflib": "0.1.20", "numpy": "1.24", "other": "1"}
    assert found(installation.check_packages(wanted, installed, "install")) == [
        ("error", "missing: rviz"),
        ("warn", "cflib is 0.1.20, tested is 0.1.34"),
    ]
    assert not found(installation.check_packages({"numpy": ""}, installed, "install"))


HOSTS = {"lab": "10.0.0.1", "me": "10.0.0.7", "localhost": "127.0.0.1", "old": "10.9.9.9"}


def network(hostname="me", **variables):
    def is_own(address):
        return address.startswith("127.") or address == "10.0.0.7"

    def resolve(name):
        return name if name[0].isdigit() else HOSTS.get(name, "")

    return Network(variables, hostname, resolve, is_own)


HERE, LAB = "http://localhost:11311", "http://lab:11311"


@pytest.mark.parametrize(
    ("given", "level", "part"),
    [
        ({}, "error", "ROS_MASTER_URI is ''"),
        ({"ROS_MASTER_URI": "http://lab:port"}, "error", "ROS_MASTER_URI is"),
        ({"ROS_MASTER_URI": "http://lab"}, "error", "ROS_MASTER_URI is"),
        ({"ROS_MASTER_URI": "http://nobody:1", "ROS_IP": "10.0.0.7"}, "error", "host 'nobody'"),
        ({"ROS_MASTER_URI": LAB, "ROS_IP": "127.0.0.1"}, "error", "only be reached from here"),
        ({"ROS_MASTER_URI": LAB, "ROS_IP": "10.0.0.8"}, "error", "no address of this computer"),
        ({"ROS_MASTER_URI": LAB, "ROS_HOSTNAME": "nobody"}, "error", "is unknown here"),
        ({"ROS_MASTER_URI": LAB, "hostname": "old"}, "error", "hostname 'old' is 10.9.9.9"),
        ({"ROS_MASTER_URI": HERE}, "warn", "whoever is in the network"),
        (
            {"ROS_MASTER_URI": HERE, "ROS_IP": "10.0.0.7", "ROS_HOSTNAME": "me"},
            "warn",
            "both ROS_HOSTNAME and ROS_IP",
        ),
    ],
)
def test_a_network_that_does_not_work(given, level, part):
    found_level, text = the_only(installation.check_network(network(**given)))
    assert found_level == level
    assert part in text


@pytest.mark.parametrize(
    "given",
    [
        {"ROS_MASTER_URI": HERE, "ROS_IP": "127.0.0.1"},
        {"ROS_MASTER_URI": LAB, "ROS_IP": "10.0.0.7"},
        {"ROS_MASTER_URI": LAB},
    ],
)
def test_a_network_that_works(given):
    assert not found(installation.check_network(network(**given)))


@pytest.mark.parametrize(
    ("writable", "free", "levels"),
    [(True, 5e9, []), (True, 5e8, ["warn"]), (True, 5e7, ["error"]), (False, 5e9, ["error"])],
)
def test_log_directory(writable, free, levels):
    findings = found(installation.check_log_directory("/logs", writable, free))
    assert [level for level, _ in findings] == levels


def usb(tmp_path, mode):
    """Make the files of a Crazyradio below a folder."""
    device = tmp_path / "sys/bus/usb/devices/1-1"
    files = {"idVendor": "1915", "idProduct": "7777", "busnum": "1", "devnum": "7"}
    device.mkdir(parents=True)
    for name, text in files.items():
        (device / name).write_text(text + "\n")
    other = tmp_path / "sys/bus/usb/devices/usb1"
    other.mkdir()
    file = tmp_path / "dev/bus/usb/001/007"
    file.parent.mkdir(parents=True)
    file.touch(mode)
    return str(file)


def test_dongles_are_found(tmp_path):
    assert look.radio(tmp_path).dongles == {}
    file = usb(tmp_path, 0o660)
    radio = look.radio(tmp_path)
    assert radio.dongles == {file: True}
    assert not radio.has_rules
    rules = tmp_path / "etc/udev/rules.d"
    rules.mkdir(parents=True)
    (rules / "99-crazyflie.rules").write_text('ATTRS{idVendor}=="1915"\n')
    assert look.radio(tmp_path).has_rules


@pytest.mark.skipif(os.geteuid() == 0, reason="root may do everything")
def test_a_dongle_without_permission(tmp_path):
    assert look.radio(tmp_path).dongles == {usb(tmp_path, 0o000): False}


def test_radio():
    uris = ["radio://0/80/2M", "udp://127.0.0.1:19850"]
    nothing = Radio({}, False, ())
    assert not found(installation.check_radio(nothing, uris[1:]))
    level, text = found(installation.check_radio(nothing, uris))[0]
    assert (level, "radio://0/80/2M" in text) == ("error", True)
    refused = Radio({"/dev/bus/usb/001/007": False}, False, ("users",))
    [finding] = installation.check_radio(refused, [])
    assert finding.level == "error"
    assert "99-crazyflie.rules" in finding.remedy
    assert "usermod" in finding.remedy
    fine = Radio({"/dev/bus/usb/001/007": True}, True, ("plugdev",))
    assert not found(installation.check_radio(fine, uris))


def test_a_master_that_does_not_answer_keeps_nobody_waiting(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as frozen:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{frozen.getsockname()[1]}")
        assert not look.is_master_online()


# Graph.

PARAMETERS = {
    "/lqr_controller/topics/control": "/control/lqr",
    "/lqr_controller/topics/reference": "ref",
    "/lqr_controller/x_dim": 7,
    "/state_estimator/frames/fixed": "/world",
    "/state_estimator/frames/robot": "crazyflie",
}

WELL = Graph(
    publishers={"/ref": {"/server"}, "/control/lqr": {"/lqr"}, "/tf": {"/simulator"}},
    subscribers={"/ref": {"/lqr"}, "/control/lqr": {"/lqr", "/filter"}, "/tf": {"/estimator"}},
    services={"/takeoff": "/server"},
    parameters=PARAMETERS,
    topic_types={("/server", "/ref"): REFERENCE, ("/lqr", "/control/lqr"): CONTROL},
    service_types={"/takeoff": ("std_srvs/Empty", "d41d8cd98f00b204e9800998ecf8427e")},
    connections={
        ("/server", "/ref", "/lqr"),
        ("/lqr", "/control/lqr", "/filter"),
        ("/simulator", "/tf", "/estimator"),
    },
)


def but(**changes):
    return dataclasses.replace(WELL, **changes)


def test_a_graph_that_is_well():
    assert not found(graph.check_nodes(WELL))
    assert not found(graph.check_types(WELL, look.own_md5))
    assert not found(graph.check_connections(WELL))
    assert not found(graph.check_publishers(WELL))
    assert not found(graph.check_drivers(WELL, {}))


def test_nodes_that_do_not_answer():
    silent = but(silent={"/lqr": "timed out"})
    assert the_only(graph.check_nodes(silent)) == ("error", "/lqr does not answer (timed out)")
    # It is not said again of each of its connections.
    assert not found(graph.check_connections(dataclasses.replace(silent, connections=set())))[2:]


@pytest.mark.parametrize(
    ("types", "level", "part"),
    [
        ({("/a", "/x"): (CONTROL[0], "0" * 32)}, "error", "/a publishes /x as crazyflie_msgs/Con"),
        ({("/a", "/x"): ("their_msgs/Thing", "0" * 32)}, "warn", "unknown here"),
        ({("/a", "/x"): CONTROL, ("/b", "/x"): REFERENCE}, "error", "/x has publishers of"),
    ],
)
def test_types_that_differ(types, level, part):
    found_level, text = the_only(graph.check_types(but(topic_types=types), look.own_md5))
    assert found_level == level
    assert part in text


def test_services_whose_types_differ():
    types = {"/takeoff": ("std_srvs/Empty", "0" * 32)}
    level, text = the_only(graph.check_types(but(service_types=types), look.own_md5))
    assert level == "error"
    assert "/server offers /takeoff" in text


def test_a_subscriber_that_is_not_connected():
    broken = but(connections=WELL.connections - {("/lqr", "/control/lqr", "/filter")})
    text = "/filter cannot hear /lqr on /control/lqr"
    assert the_only(graph.check_connections(broken)) == ("error", text)


def test_topics_without_a_publisher():
    nobody = but(publishers={"/control/lqr": {"/lqr"}})
    assert found(graph.check_publishers(nobody)) == [
        ("error", "/ref has no publisher, /lqr waits for it"),
        ("error", "nobody publishes /tf"),
    ]


def test_an_input_that_may_be_missing():
    parameters = {"/merger/topics/prioritized_control": "/avoid"}
    waiting = Graph(parameters=parameters, subscribers={"/avoid": {"/merger"}})
    assert the_only(graph.check_publishers(waiting))[0] == "warn"


def test_two_sources():
    publishers = {**WELL.publishers, "/ref": {"/server", "/me"}, "/control/lqr": {"/lqr", "/me"}}
    assert found(graph.check_publishers(but(publishers=publishers))) == [
        ("error", "/control/lqr comes from /lqr, /me"),
        ("warn", "the reference /ref comes from /me, /server"),
    ]


def test_two_drivers_of_one_vehicle():
    uri = "radio://0/80/2M"
    twice = but(parameters={"/cf1/add/uri": uri, "/cf2/add/uri": uri, "/cf3/add/uri": "udp://x:1"})
    assert found(graph.check_drivers(twice, {uri: {"/a", "/b"}, "udp://x:1": {"/a"}})) == [
        ("error", f"{uri} is flown by /a, /b"),
        ("error", f"{uri} is added by /cf1/add, /cf2/add"),
    ]


# Time, tf, delay.


def stream(child="crazyflie", parent="world", node="/mocap", period=0.01, age=0.002, count=100):
    return [
        Transform(parent, child, node, 50.0 + k * period, 50.0 + k * period + age)
        for k in range(count)
    ]


def test_motion_that_is_well(tmp_path):
    heard = Heard(transforms=stream() + stream("crazyflie/base_link", "crazyflie", "/static", 0.1))
    for check in (
        motion.check_clock,
        motion.check_tf_tree,
        motion.check_frames,
        motion.check_tf_rate,
        motion.check_gains,
    ):
        assert not found(check(WELL, heard))


@pytest.mark.parametrize(
    ("simulated", "sources", "clocks", "part"),
    [
        (True, set(), [], "nothing comes on /clock"),
        (True, {"/sim"}, [1.0, 1.0], "/clock stands still"),
        (True, {"/sim", "/bag"}, [1.0, 2.0], "/clock comes from /bag, /sim"),
        (False, {"/sim"}, [1.0, 2.0], "/sim publishes /clock, but /use_sim_time is not true"),
    ],
)
def test_clocks(simulated, sources, clocks, part):
    given = but(parameters={"/use_sim_time": simulated}, publishers={"/clock": sources})
    level, text = the_only(motion.check_clock(given, Heard(clocks=clocks)))
    assert level == "error"
    assert part in text


def test_simulated_time_that_goes():
    given = but(parameters={"/use_sim_time": True}, publishers={"/clock": {"/sim"}})
    assert not found(motion.check_clock(given, Heard(clocks=[1.0, 2.0])))


def test_a_node_that_lives_by_another_clock():
    level, text = the_only(motion.check_clock(WELL, Heard(transforms=stream(age=1.7e9))))
    assert level == "error"
    assert "/mocap stamps transforms by another clock" in text


@pytest.mark.parametrize(
    ("transforms", "part"),
    [
        (stream() + stream(parent="map", node="/other"), "crazyflie has the parents map, world"),
        (stream() + stream(node="/other"), "transform of crazyflie comes from /mocap, /other"),
        (stream("a", "b") + stream("b", "a"), "tf has a loop: a -> b -> a"),
        (
            [Transform("a", "b", node, 0.0, 1.0, is_static=True) for node in ("/1", "/2")],
            "the static transform of b comes from /1, /2",
        ),
    ],
)
def test_no_tree(transforms, part):
    level, text = the_only(motion.check_tf_tree(WELL, Heard(transforms=transforms)))
    assert level == "error"
    assert part in text


def test_frames_that_nobody_publishes():
    level, text = the_only(motion.check_frames(WELL, Heard(transforms=stream("crazyfly"))))
    assert level == "error"
    assert "the frame crazyflie that /state_estimator needs (did you mean crazyfly?)" in text
    apart = Heard(transforms=stream("a") + stream("crazyflie", "map"))
    assert "does not connect world and crazyflie" in the_only(motion.check_frames(WELL, apart))[1]


@pytest.mark.parametrize(
    ("transforms", "level", "part"),
    [
        (stream(period=0.04), "warn", "comes at 25.0 Hz"),
        (stream(period=0.2), "error", "comes at 5.0 Hz"),
        (stream(period=0.0), "error", "stands still"),
        (stream(age=0.3), "error", "is 0.30 s old"),
        (stream(age=-8.0), "error", "is 8.00 s ahead"),
        (stream()[:40] + stream()[60:], "warn", "pauses for 0.21 s"),
    ],
)
def test_poor_poses(transforms, level, part):
    found_level, text = the_only(motion.check_tf_rate(WELL, Heard(transforms=transforms)))
    assert found_level == level
    assert part in text


def test_a_constant_link_between_vehicle_and_world_may_be_slow():
    slow = stream("crazyflie", "vicon/cf7", "/static", 0.1, age=-0.1)
    heard = Heard(transforms=stream("vicon/cf7") + slow)
    assert not found(motion.check_tf_rate(WELL, heard))


@pytest.mark.parametrize(
    ("used", "levels"), [(0.5, []), (0.9, ["warn"]), (1.1, ["error"])], ids=["fits", "near", "late"]
)
def test_gains_and_delay(tmp_path, used, levels):
    file = tmp_path / "K.txt"
    file.write_text(SOFT)
    margin, _ = motion.delay_margin(str(file), near_hover())
    parameters = {**PARAMETERS, "/lqr_controller/K_file": str(file)}
    # Each control is held for a period: half of it counts.
    period = 0.01
    late = used * margin - 0.5 * period
    stamps = [k * period for k in range(100)]
    heard = Heard(delays={"/control/lqr": [late] * 100}, control_stamps={"/control/lqr": stamps})
    findings = found(motion.check_gains(but(parameters=parameters), heard))
    assert [level for level, _ in findings] == levels


def test_a_gain_file_that_is_gone():
    parameters = {**PARAMETERS, "/lqr_controller/K_file": "/nowhere/K.txt"}
    heard = Heard(delays={"/control/lqr": [0.0, 0.0]}, control_stamps={"/control/lqr": [1.0, 1.01]})
    level, text = the_only(motion.check_gains(but(parameters=parameters), heard))
    assert level == "error"
    assert "cannot read /nowhere/K.txt" in text
