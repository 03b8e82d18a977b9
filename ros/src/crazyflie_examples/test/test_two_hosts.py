"""A fleet on two hosts with one master: network namespaces, joined by a cable of their own."""

import os
import shutil
import subprocess
import sys

import pytest

from crazyflie_utils.testing.programs import running, wait_until

HERE, THERE = "10.213.7.1", "10.213.7.2"
LIMIT = 120.0
"""How long a user's script may take, s."""

FLEET = """
machines:
  far: {address: 10.213.7.2, env_loader: /env.sh}
robots:
  cf1: {initial_position: [0, 0, 0]}
  cf2: {initial_position: [1, 0, 0]}
  cf3: {initial_position: [0, 1, 0], machine: far}
  cf4: {initial_position: [1, 1, 0], machine: far}
"""

# Programs that a user runs next to the master.
SCRIPT = """
import sys, time
import rosgraph, rospy
from std_srvs.srv import Empty
from crazyflie_msgs.msg import PositionVelocityYawStateStamped

rospy.init_node("user")
heights = {}
for name in ("cf1", "cf2", "cf3", "cf4"):
    rospy.Subscriber(
        f"/{name}/state",
        PositionVelocityYawStateStamped,
        lambda message, name=name: heights.update({name: message.state.z}),
    )

def wait(condition):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, heights
        time.sleep(0.02)

def fly(service):
    rospy.wait_for_service(service, 30.0)
    rospy.ServiceProxy(service, Empty)()

"""

pytestmark = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("ip") is None,
    reason="network namespaces need root, and ip of Debian's iproute2",
)


class Host:
    """A network namespace, for as long as a process is in it."""

    def __init__(self, holder, address):
        self._net = f"/proc/{holder.pid}/ns/net"
        self._address = address
        self.id = holder.pid
        wait_until(lambda: os.readlink(self._net) != os.readlink("/proc/self/ns/net"), "the host")

    def command(self, *words):
        return ["nsenter", f"--net={self._net}", *words]

    def run(self, *words):
        subprocess.run(self.command(*words), check=True, timeout=LIMIT, env=self.environment)

    @property
    def environment(self):
        uri = f"http://{HERE}:11311"
        return {**os.environ, "ROS_IP": self._address, "ROS_MASTER_URI": uri}

    def begin(self):
        """Be reachable; the cable is there."""
        self.run("ip", "link", "set", "lo", "up")
        self.run("ip", "address", "add", f"{self._address}/24", "dev", "cable")
        self.run("ip", "link", "set", "cable", "up")


@pytest.fixture
def hosts():
    """Yield the two hosts."""
    holder = ("unshare", "--net", "sleep", "infinity")
    with running(*holder) as first, running(*holder) as second:
        here, there = Host(first, HERE), Host(second, THERE)
        peer = ("peer", "name", "cable", "netns", str(there.id))
        here.run("ip", "link", "add", "cable", "type", "veth", *peer)
        here.begin()
        there.begin()
        yield here, there


def launched(host, log, fleet, machine, name):
    """Launch the vehicles of one machine of the fleet."""
    swarm = ("roslaunch", "--wait", "crazyflie_examples", "sw_swarm.launch", "rviz:=false")
    if machine == "local":
        swarm = (swarm[0], *swarm[2:])
    command = host.command(*swarm, f"fleet:={fleet}", f"machine:={machine}", f"name:={name}")
    return running(*command, env=host.environment, stdout=log, stderr=subprocess.STDOUT)


# On one host the same fleet flies in swarm.test.
@pytest.mark.long
def test_two_hosts_fly_one_fleet(hosts, tmp_path):
    here, there = hosts
    fleet = tmp_path / "fleet.yaml"
    fleet.write_text(FLEET)

    def user(text):
        here.run(sys.executable, "-c", SCRIPT + text)

    with (
        (tmp_path / "log").open("w") as log,
        launched(here, log, fleet, "local", "fleet"),
        launched(there, log, fleet, "far", "fleet_far"),
    ):
        user("""
wait(lambda: len(heights) == 4)
for node, address in (("/fleet", "10.213.7.1"), ("/fleet_far", "10.213.7.2")):
    assert rosgraph.Master("/user").lookupNode(node).startswith(f"http://{address}:")
fly("/all/takeoff")
wait(lambda: all(0.95 < height < 1.05 for height in heights.values()))
""")
        # The far vehicles are controlled where they are: they hover on.
        there.run("ip", "link", "set", "cable", "down")
        user("""
wait(lambda: len(heights) == 2)
fly("/cf1/land")
wait(lambda: heights["cf1"] < 0.05)
assert 0.95 < heights["cf2"] < 1.05
""")
        there.run("ip", "link", "set", "cable", "up")
        user("""
wait(lambda: len(heights) == 4)
for name in ("cf2", "cf3", "cf4"):
    assert 0.95 < heights[name] < 1.05
    fly(f"/{name}/land")
wait(lambda: all(height < 0.05 for height in heights.values()))
""")
