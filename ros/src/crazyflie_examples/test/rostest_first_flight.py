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
from geometry_msgs.msg import PoseStamped, Transform, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from crazyflie_driver.positioning import COMPLEMENTARY, ESTIMATOR, KALMAN
from crazyflie_link.crazyflie import Crazyflie
from crazyflie_utils.ros1.master_watch import living_node
from crazyflie_utils.testing.programs import free_port, running, wait_until

# Some steps of the protocol; PLACE is a part of "poses by hand", and launches the driver.
PLACE = "place"
PROGRAM = """
import sys
from crazyflie_examples import first_flight, first_flight_program

arguments, names = sys.argv[1:6], sys.argv[6:]
place = first_flight.Step("place", "put it there", lambda rig, _: rig.carry(0, 0, 0, 0) or "")
first_flight.STEPS = tuple(
    each for name in names for each in (place, *first_flight.STEPS) if each.name == name
)
sys.exit(first_flight_program.main(arguments))
"""
OWN = ("/crazyflie_server", "/takeoff_server")


class Terminal:
    """A terminal in which steps of the protocol run, and their virtual vehicle."""

    def __init__(self, stack, folder, steps, positioning="lighthouse"):
        name, port = f"virtual_{free_port()}", free_port()
        deck = "none" if positioning == "mocap" else positioning
        parameters = (f"_port:={port}", f"_positioning:={deck}", "_observer/port:=0")
        vehicle = ("rosrun", "crazyflie_virtual", "virtual_crazyflie", f"__name:={name}")
        stack.enter_context(running(*vehicle, *parameters))
        self.height = None
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        rospy.Subscriber(f"/{name}/true_pose", PoseStamped, self._on_pose)
        self.output, self._folder = "", folder
        self._keys, terminal = pty.openpty()
        self._has_read_all = threading.Event()
        threading.Thread(target=self._read, daemon=True).start()
        self.uri = f"udp://127.0.0.1:{port}"
        wait_until(lambda: self.height is not None, "the virtual vehicle")
        if positioning == "mocap":
            # As a vehicle without decks begins.
            with Crazyflie(self.uri) as bare:
                bare.parameters.write(ESTIMATOR, COMPLEMENTARY)
        options = ("--positioning", positioning, "--out", folder)
        command = (sys.executable, "-c", PROGRAM, self.uri, *options, *steps)
        ends = {"stdin": terminal, "stdout": terminal, "stderr": terminal}
        self.program = stack.enter_context(running(*command, **ends))
        os.close(terminal)
        for step in steps:
            self.wait_for(f"{step}: ")
            self.type("\n")

    def _on_pose(self, message):
        place = message.pose.position
        self.height = place.z
        # Motion capture, with its frame's name by default.
        transform = Transform(Vector3(place.x, place.y, place.z), message.pose.orientation)
        pose = TransformStamped(message.header, "HY5/base_link", transform)
        self._tf.publish(TFMessage([pose]))

    def _read(self):
        # EIO: the program has ended.
        with contextlib.suppress(OSError):
            while data := os.read(self._keys, 4096):
                self.output += data.decode(errors="replace")
        self._has_read_all.set()

    def log(self, launch):
        """Return what a launch has printed so far."""
        return "".join(log.read_text() for log in self._folder.glob(f"*/{launch}.log"))

    def wait_for(self, text):
        """Wait until the program has printed a text."""
        ended = self.program.poll
        wait_until(lambda: text in self.output or ended() is not None, repr(text))
        wait_until(lambda: text in self.output or self._has_read_all.is_set(), repr(text))
        assert text in self.output, self.output

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
        launches = ("pgrep", "-f", f"roslaunch.*{self.uri}")
        assert subprocess.run(launches, capture_output=True, check=False).stdout == b""


@pytest.fixture
def terminal(tmp_path):
    with contextlib.ExitStack() as stack:
        yield lambda *steps, **options: Terminal(stack, tmp_path, steps, **options)


def test_a_driver_that_dies_in_its_hover_ends_the_flight(terminal):
    flight = terminal(PLACE, "hover by the driver")
    flight.hovers()
    driver = living_node("/crazyflie_server")
    os.kill(int(driver.split()[1]), signal.SIGKILL)
    flight.wait_for("FAILED  hover by the driver: ")
    # On a busy computer roslaunch notices it later than the silence is.
    reasons = "the launch has ended", "has come for 1 s in flight"
    assert any(reason in flight.output for reason in reasons)
    flight.ends()


def test_a_second_signal_leaves_nothing_behind(terminal):
    flight = terminal(PLACE, "hover by the driver")
    flight.hovers()
    flight.program.send_signal(signal.SIGINT)
    wait_until(lambda: flight.height < 0.25, "the landing")
    flight.program.send_signal(signal.SIGINT)
    flight.ends()


def test_a_key_ends_a_takeoff(terminal):
    flight = terminal(PLACE, "hover by the LQR")
    wait_until(lambda: "/takeoff_server: taking off" in flight.log("hw_hover"), "the takeoff")
    flight.type("x\n")
    flight.wait_for("FAILED  hover by the LQR: ended by the pilot")
    flight.ends()
    assert "/takeoff_server: flying" not in flight.log("hw_hover")
    # Only warnings are shown.
    assert "/takeoff_server: taking off" not in flight.output
    assert "PARAMETERS" not in flight.output


def test_a_vehicle_without_decks_flies_by_its_poses(terminal):
    flight = terminal("doctor", PLACE, "hover by the driver", positioning="mocap")
    flight.hovers()
    assert rospy.get_param(f"/crazyflie/{ESTIMATOR.replace('.', '/')}") == KALMAN
    flight.wait_for("passed  hover by the driver: ")
    flight.ends()
