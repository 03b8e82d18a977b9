"""Network settings and messages of sourcing the workspace."""

import subprocess
from pathlib import Path

import pytest

HOOK = Path(__file__).parents[1] / "env-hooks" / "60.crazyflie_network.sh"


def ros_ip(variables):
    """Return ROS_IP after the hook, in a shell that treats unset variables as errors."""
    done = subprocess.run(
        ["/bin/sh", "-euc", f'. "{HOOK}"; env'],
        env=variables,
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return dict(line.split("=", 1) for line in done.stdout.splitlines()).get("ROS_IP")


@pytest.mark.parametrize(
    "uri",
    [
        "http://localhost:11311",
        "http://localhost:11311/",
        "http://localhost",
        "http://127.0.0.1:11311",
        "http://127.0.1.1:7/",
        None,
    ],
)
def test_a_master_here_is_for_this_computer_only(uri):
    assert ros_ip({} if uri is None else {"ROS_MASTER_URI": uri}) == "127.0.0.1"


@pytest.mark.parametrize(
    "uri", ["http://lab:11311", "http://localhost.lab:11311", "http://10.0.0.1:1"]
)
def test_a_master_elsewhere_must_reach_the_nodes(uri):
    assert ros_ip({"ROS_MASTER_URI": uri}) is None


def test_what_was_decided_stays():
    assert ros_ip({"ROS_IP": "10.0.0.7"}) == "10.0.0.7"
    assert ros_ip({"ROS_HOSTNAME": "me"}) is None
    assert ros_ip({"ROS_IP": "", "ROS_HOSTNAME": ""}) == "127.0.0.1"
