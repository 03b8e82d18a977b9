"""Examples on two simulated vehicles of a fleet; they stand at y = -0.5 and 0.5 m."""

import numpy as np
import pytest
from scripted import ctrl_c, fly, kill_node, run, run_until

NEAR = 0.1  #: m; the controllers follow a little behind.

FAULTY = """
from pycrazyswarm import Crazyswarm

swarm = Crazyswarm()
cf1, cf2 = swarm.allcfs.crazyflies
swarm.allcfs.takeoff(0.8, 2.0)
swarm.timeHelper.sleep(4.0)
print("bits", [cf.get_status()["supervisor"] for cf in (cf1, cf2)])
print("height", round(cf1.position()[2], 1), "speed", round(abs(cf1.velocity()[0]), 1))
swarm.allcfs.setParam("usd.logging", 1)
print("logging", cf2.getParam("usd/logging"))
cf1.goTo([0.0, 0.0, -1.0], 0.0, 2.0)
"""


BELOW_GROUND = """
from pycrazyswarm import Crazyswarm

swarm = Crazyswarm()
swarm.allcfs.takeoff(0.8, 2.0)
swarm.timeHelper.sleep(4.0)
swarm.allcfs.crazyflies[0].goTo([0.0, -0.5, -1.0], 0.0, 2.0)
swarm.allcfs.land(0.04, 2.5)
swarm.timeHelper.sleep(3.0)
"""


def lands(track):
    """Return whether vehicles are above their first places, on the ground or nearly so.

    The takeoff server's landing takes a little longer than the scripts wait.
    """
    places = np.allclose(track[-1, :, :2], track[0, :, :2], atol=NEAR)
    return places and track[-1, :, 2].max() < 0.4


def test_nice_hover():
    track = fly("nice_hover.py")
    assert track[1] == pytest.approx(np.c_[track[0, :, :2], [1.0, 1.0]], abs=0.05)
    assert lands(track)


# The calls of these examples are tested without a master; one flight and its ends remain.
@pytest.mark.long
def test_groups():
    track = fly("group_mask.py")
    assert track[0, :, 2] == pytest.approx([1.0, 0.0], abs=NEAR)
    assert track[1, :, 2] == pytest.approx([1.0, 0.5], abs=NEAR)
    assert track[2, :, 2] == pytest.approx([1.0, 1.0], abs=NEAR)
    assert lands(track)


@pytest.mark.long
def test_trajectories():
    track = fly("multi_trajectory.py")
    assert track[1] == pytest.approx(track[0] + [0.8, 0.0, 0.0], abs=NEAR)
    assert track[2] == pytest.approx(track[0], abs=NEAR)


@pytest.mark.long
def test_swap():
    track = fly("swap.py")
    assert track[1, :, :2] == pytest.approx(track[0, ::-1, :2], abs=NEAR)


@pytest.mark.long
def test_setpoints():
    # A figure eight, and back to where it began.
    track = fly("full_state.py")[:, 0]
    assert np.ptp(track[:, 0]) > 1.3
    assert np.ptp(track[:, 1]) > 0.7
    assert track[-1, :2] == pytest.approx(track[0, :2], abs=NEAR)


TURNING = """
import math
from pycrazyswarm import Crazyswarm

swarm = Crazyswarm()
cf1, cf2 = swarm.allcfs.crazyflies
swarm.allcfs.takeoff(1.0, 2.5)
swarm.timeHelper.sleep(4.0)
print("begins at", abs(round(cf1.yaw(), 1)))
side = math.copysign(1.0, cf1.position()[1])  # Away from the other, wherever it stands.
cf1.goTo([0.0, side * 0.5, 1.0], math.pi / 2.0, 2.0)
swarm.timeHelper.sleep(3.0)
print("turned to", abs(round(cf1.yaw(), 1)))
cf1.goTo([0.4, side * 0.8, 1.0], math.pi / 2.0, 2.0)
swarm.timeHelper.sleep(3.0)
print("moved to", abs(round(cf1.yaw(), 1)), [abs(round(float(each), 1)) for each in cf1.position()])
"""


def test_vehicles_turn(tmp_path):
    script = tmp_path / "turning.py"
    script.write_text(TURNING)
    printed = run(script)
    assert "begins at 0.0" in printed
    assert "turned to 1.6" in printed
    assert "moved to 1.6 [0.4, 0.8, 1.0]" in printed
    # A whole dance, with four turns.
    track = fly("dance.py")
    assert track[0] != pytest.approx(track[2], abs=0.1)
    assert lands(track)


def test_what_is_refused_is_a_warning_if_it_is_asked_for(tmp_path):
    script = tmp_path / "below.py"
    script.write_text(BELOW_GROUND)
    text = "cf1: goTo: z is -1 m, outside the fence; expected 0 to inf m"
    assert text in run(script, status=1)
    assert text in run(script, "--unchecked")


def test_the_end_of_a_script_lands(tmp_path):
    script = tmp_path / "faulty.py"
    script.write_text(FAULTY)
    printed = run(script, status=1)
    assert "bits [27, 27]" in printed
    assert "height 0.8 speed 0.0" in printed
    assert printed.count("setParam: the simulation has no parameter usd.logging") == 1
    assert "logging 1" in printed
    assert "cf1: goTo: z is -1 m, outside the fence; expected 0 to inf m" in printed
    assert "landing cf1, cf2" in printed
    # On the ground, or the takeoff would be refused.
    assert fly("hello_world.py")[0, 0, 2] == pytest.approx(1.0, abs=NEAR)


@pytest.mark.parametrize("ending", ["rospy.spin()", "swarm.timeHelper.sleep(1e6)"])
@pytest.mark.parametrize("end", [ctrl_c, kill_node])
def test_however_ros_is_shut_down_the_script_lands_before(tmp_path, ending, end):
    errors = run_until(tmp_path, ending, end)
    assert "landing cf1, cf2" in errors
    assert "MAY STILL FLY" not in errors
    # On the ground, or the takeoff would be refused.
    assert fly("hello_world.py")[0, 0, 2] == pytest.approx(1.0, abs=NEAR)
