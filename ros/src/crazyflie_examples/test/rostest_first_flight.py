"""The command `first_flight` at a terminal, and what ends it in flight."""

import contextlib
import os
import pty
import signal
import subprocess
import sys
import threading

import pytest
import rospy
from geometry_msgs.msg import PoseStamped

from crazyflie_utils.ros1.master_watch import living_node
from crazyflie_utils.testing.programs import free_port, running, wait_until

# The protocol with one flight only; `carry` launches the driver.
PROGRAM = """
import sys
from crazyflie_examples import first_flight, first_flight_program

uri, out, step = sys.argv[1:]
first_flight.STEPS = (
    first_flight.Step("place", "put it there", lambda rig, _: rig.carry(0, 0, 0, 0) or ""),
    *(each for each in first_flight.STEPS if each.name == step),
)
sys.exit(first_flight_program.main([uri, "--positioning", "lighthouse", "--out", out]))
"""
OWN = ("/crazyflie_server", "/takeoff_server")


class Terminal:
    """A terminal in which a protocol of one flight runs, and its virtual vehicle."""

    def __init__(self, stack, folder, step):
        name, port = f"virtual_{free_port()}", free_port()
        parameters = (f"_port:={port}", "_positioning:=lighthouse", "_observer/port:=0")
        vehicle = ("rosrun", "crazyflie_virtual", "virtual_crazyflie", f"__name:={name}")
        stack.enter_context(running(*vehicle, *parameters))
        self.height = 0.0
        rospy.Subscriber(f"/{name}/true_pose", PoseStamped, self._on_pose)
        self.output = ""
        self._keys, terminal = pty.openpty()
        threading.Thread(target=self._read, daemon=True).start()
        self._uri = f"udp://127.0.0.1:{port}"
        command = (sys.executable, "-c", PROGRAM, self._uri, folder, step)
        ends = {"stdin": terminal, "stdout": terminal, "stderr": terminal}
        self.program = stack.enter_context(running(*command, **ends))
        os.close(terminal)
        for question in ("place", step):
            self.wait_for(f"{question}: ")
            self.type("\n")

    def _on_pose(self, message):
        self.height = message.pose.position.z

    def _read(self):
        # EIO: the program has ended.
        with contextlib.suppress(OSError):
            while data := os.read(self._keys, 4096):
                self.output += data.decode(errors="replace")

    def wait_for(self, text):
        """Wait until the program has printed a text."""
        wait_until(lambda: text in self.output, f"{text!r} in {self.output[-2000:]}")

    def type(self, text):
        """Type a text."""
        os.write(self._keys, text.encode())

    def hovers(self):
        """Wait until the vehicle hovers."""
        wait_until(lambda: self.height > 0.25, "the hover")

    def ends(self):
        """Wait until the program, all that it has launched and the flight have ended."""
        assert self.program.wait(60.0) == 1, self.output
        wait_until(lambda: self.height < 0.05, "the end of the flight")
        wait_until(lambda: not any(living_node(name) for name in OWN), f"the end of {OWN}")
        launches = ("pgrep", "-f", f"roslaunch.*{self._uri}")
        assert subprocess.run(launches, capture_output=True, check=False).stdout == b""


@pytest.fixture
def terminal(tmp_path):
    with contextlib.ExitStack() as stack:
        yield lambda step: Terminal(stack, tmp_path, step)


def test_a_driver_that_dies_in_its_hover_ends_the_flight(terminal):
    flight = terminal("hover by the driver")
    flight.hovers()
    driver = living_node("/crazyflie_server")
    os.kill(int(driver.split()[1]), signal.SIGKILL)
    flight.wait_for("FAILED  hover by the driver: the launch has ended")
    flight.ends()


def test_a_second_signal_leaves_nothing_behind(terminal):
    flight = terminal("hover by the driver")
    flight.hovers()
    flight.program.send_signal(signal.SIGINT)
    wait_until(lambda: flight.height < 0.25, "the landing")
    flight.program.send_signal(signal.SIGINT)
    flight.ends()


def test_a_key_ends_a_takeoff(terminal):
    flight = terminal("hover by the LQR")
    flight.wait_for("/takeoff_server: taking off")
    flight.type("x\n")
    flight.wait_for("FAILED  hover by the LQR: ended by the pilot")
    flight.ends()
    assert "/takeoff_server: flying" not in flight.output
