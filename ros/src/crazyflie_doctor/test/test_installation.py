"""The doctor's checks of an installation, on data."""

import os
import socket
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from doctor_findings import found, the_only

from crazyflie_doctor import computer, installation, running_graph
from crazyflie_doctor.finding import Check, error, lines, warn
from crazyflie_doctor.installation import Network, Python, Radio


def test_a_line_for_each_finding_or_one_that_says_what_is_fine():
    assert list(lines(Check("logs", "much space", []))) == [("ok", "ok     logs: much space")]
    both = lines(Check("logs", "", [warn("little space", "free some"), error("a", "b")]))
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
        ({"ROS_MASTER_URI": HERE}, "warn", "any computer in the network"),
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
    assert computer.radio(tmp_path).dongles == {}
    file = usb(tmp_path, 0o660)
    radio = computer.radio(tmp_path)
    assert radio.dongles == {file: True}
    assert not radio.has_rules
    rules = tmp_path / "etc/udev/rules.d"
    rules.mkdir(parents=True)
    (rules / "99-crazyflie.rules").write_text('ATTRS{idVendor}=="1915"\n')
    assert computer.radio(tmp_path).has_rules


@pytest.mark.skipif(os.geteuid() == 0, reason="root may do everything")
def test_a_dongle_without_permission(tmp_path):
    assert computer.radio(tmp_path).dongles == {usb(tmp_path, 0o000): False}


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


def test_a_node_is_no_master(monkeypatch):
    with SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False) as node:
        node.register_function(lambda _: [1, "", 1], "getPid")
        threading.Thread(target=node.handle_request, daemon=True).start()
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{node.server_address[1]}")
        assert not running_graph.is_master_online()


def test_a_master_that_does_not_answer_blocks_no_check(monkeypatch):
    with socket.create_server(("127.0.0.1", 0)) as frozen:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{frozen.getsockname()[1]}")
        assert not running_graph.is_master_online()
