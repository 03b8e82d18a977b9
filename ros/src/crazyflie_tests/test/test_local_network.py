"""Who has sourced the workspace, and no more, opens nothing to the network."""

import os
import socket
import subprocess
from pathlib import Path

import pytest
from workspaces import FAST, TOP, clean_environment

from crazyflie_utils.testing.programs import free_port, running, wait_until

LISTEN = "0A"
"""State of a TCP socket in /proc/net/tcp."""

IN_CPP = {"rosout", "static_transfor"}
"""Programs in C++, as Linux calls them: their port for XML-RPC is open in any case."""


def listening(top):
    """Return (program, address) of each TCP socket on which a process or its children listen."""
    sockets = {}
    for table, size in (("tcp", 8), ("tcp6", 32)):
        for line in Path("/proc/net", table).read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == LISTEN:
                sockets[f"socket:[{fields[9]}]"] = _address(fields[1][:size])
    return {
        (name, sockets[link])
        for pid, name in _family(top).items()
        for link in _links(pid)
        if link in sockets
    }


def _address(digits):
    words = [bytes.fromhex(digits[k : k + 8])[::-1] for k in range(0, len(digits), 8)]
    family = socket.AF_INET if len(words) == 1 else socket.AF_INET6
    return socket.inet_ntop(family, b"".join(words))


def _family(top):
    """Return the names of a process and all its descendants, by pid."""
    parents, names = {}, {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            head, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        pid = int(stat.parent.name)
        names[pid] = head.partition("(")[2]
        parents[pid] = int(rest.split()[1])
    family = {top}
    while more := {pid for pid, parent in parents.items() if parent in family} - family:
        family |= more
    return {pid: names[pid] for pid in family if pid in names}


def _links(pid):
    for link in Path(f"/proc/{pid}/fd").glob("*"):
        try:
            yield os.readlink(link)
        except OSError:
            continue


@pytest.fixture
def environment(home):
    """Return what a shell has in which nothing was said about the network."""
    variables = clean_environment(home)
    del variables["ROS_IP"]
    port = free_port(socket.SOCK_STREAM)
    return {**variables, "ROS_MASTER_URI": f"http://localhost:{port}"}


def test_a_launch_is_for_this_computer_only(environment):
    port = environment["ROS_MASTER_URI"].rpartition(":")[2]
    command = (
        f"source {TOP}/ros/devel/setup.bash && "
        f"exec roslaunch -p {port} crazyflie_examples sw_hover.launch {FAST}"
    )
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with running("bash", "-c", command, env=environment, **quiet) as launch:

        def found():
            return listening(launch.pid)

        expected = {"rosmaster", "composed_node", "rosout", "static_transfor"}
        wait_until(lambda: {name for name, _ in found()} >= expected, "all programs", period=0.2)
        # Nodes have more than one socket, and open them one after another.
        wait_until(lambda: ("static_transfor", "127.0.0.1") in found(), "sockets", period=0.2)
        open_to_all = {name for name, address in found() if not address.startswith("127.")}
    assert open_to_all <= IN_CPP


def test_without_the_workspace_the_master_is_open_to_all(environment):
    port = environment["ROS_MASTER_URI"].rpartition(":")[2]
    with running("/usr/bin/rosmaster", "--core", "-p", port, env=environment) as master:
        wait_until(lambda: listening(master.pid), "a socket", period=0.2)
        assert {address for _, address in listening(master.pid)} <= {"0.0.0.0", "::"}
