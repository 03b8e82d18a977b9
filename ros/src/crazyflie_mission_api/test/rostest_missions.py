"""Missions of two simulated vehicles, as fast as possible; they stand at y = -0.5 and 0.5 m."""

import math
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rosnode
import rospkg
from flown import LIMIT, nearest, recorded, run, script

from crazyflie_utils.testing import peer

PACKAGE = Path(rospkg.RosPack().get_path("crazyflie_mission_api"))

WAITING = """
from crazyflie_mission_api import Bounds, Fleet, MissionError

def mission(fleet):
    fleet.takeoff(1.0)
    fleet["cf2"].go_to((0.0, 5.0, 1.0))

with Fleet(["cf1", "cf2"], bounds=Bounds((-2, -2, 0), (2, 2, 2))) as fleet:
    try:
        fleet.fly(mission)
    except MissionError as error:
        assert "cf2: go_to is out of bounds: y is 5 m; expected -2 to 2 m" in str(error)
    assert fleet.flying == []
    assert fleet.position("cf1")[2] < 0.05
    fleet.takeoff(0.8)
    fleet.wait(1e6)
"""

# A script of a user of the module: its commands return at once, so it waits for their ends.
OLD = """
import rospy
from crazyflie import Crazyflie

def wait_for(condition):
    end = rospy.Time.now() + rospy.Duration(20.0)
    while not condition():
        assert rospy.Time.now() < end, cf.position()
        rospy.sleep(0.05)

rospy.init_node("script")
cf = Crazyflie("cf1", "/cf1")
x, y, _ = cf.position()
cf.setParam("commander/enHighLevel", 1)
cf.takeoff(targetHeight=0.6, duration=2.0)
wait_for(lambda: cf.position()[2] > 0.55)
cf.goTo(goal=[0.5, 0.0, 0.0], yaw=0.0, duration=2.0, relative=True)
wait_for(lambda: abs(cf.position()[0] - x - 0.5) < 0.1)
for k in range(100):
    cf.cmdPosition((x + 0.5, y - 0.005 * k, 0.6))
    rospy.sleep(0.02)
cf.notifySetpointsStop()
wait_for(lambda: abs(cf.position()[1] - y + 0.5) < 0.1)
cf.land(targetHeight=0.0, duration=2.0)
wait_for(lambda: cf.position()[2] < 0.05)
cf.stop()
"""


def written(tmp_path, text):
    """Return the path of a script."""
    path = tmp_path / "mission.py"
    path.write_text(text)
    return path


def landed(tracks):
    """Return whether both stand."""
    return all(track[-1][2] < 0.05 for track in tracks.values())


# test_dry_run.py flies such a script, and test_landing.py kills one.
@pytest.mark.long
def test_the_script_of_the_readme(tmp_path):
    text = re.search(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.S).group(1)
    with recorded(["cf1", "cf2"]) as tracks:
        status, errors = run(written(tmp_path, text))
        assert (status, errors) == (0, "")
        assert landed(tracks)
    assert nearest(tracks["cf1"], (0.5, -1.0, 1.2)) < 0.16
    for point in ((0.5, 1.0, 1.4), (0.0, 1.5, 1.0)):
        assert nearest(tracks["cf2"], point) < 0.16
    ends = sorted(track[-1][0] for track in tracks.values())
    assert ends == pytest.approx([-0.5, 0.5], abs=0.16)


def test_ctrl_c_lands_and_what_is_wrong_is_known_before(tmp_path):
    with recorded(["cf1", "cf2"]) as tracks, script(written(tmp_path, WAITING)) as process:
        try:
            peer.wait_until(lambda: all(t[-1][2] > 0.7 for t in tracks.values()), "takeoff", LIMIT)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=LIMIT)
        finally:
            process.kill()
        assert "KeyboardInterrupt" in errors
        assert landed(tracks)


# The file is made by a thread: a signal must not come before the script's last line.
SHUT_DOWN = """
import pathlib, sys, threading, rospy
from crazyflie_mission_api import Fleet

with Fleet(["cf1", "cf2"]) as fleet:
    fleet.takeoff(0.8)
    threading.Thread(target=pathlib.Path(sys.argv[1]).touch).start()
    {ending}
"""
NODE = "/flier"

# It does not read /clock: a publisher keeps only the latest connection of each name.
SECOND_NODE = "import rospy; rospy.init_node('flier', disable_rostime=True)"


def ctrl_c(process):
    """Send the signal of Ctrl-C to a script."""
    process.send_signal(signal.SIGINT)


SWALLOWING = """while True:
        try:
            fleet.wait(1e6)
        except KeyboardInterrupt:
            pathlib.Path(sys.argv[1] + ".again").touch()
"""


def ctrl_c_twice(process):
    """Send a second signal when the script has handled the first one, and flies on."""
    ctrl_c(process)
    peer.wait_until(Path(f"{process.args[2]}.again").exists, "the first one's end", LIMIT)
    ctrl_c(process)


def kill_node(_):
    """Ask the script's node to shut down, as rosnode kill does."""
    assert rosnode.kill_nodes([NODE]) == ([NODE], [])


def start_second_node(_):
    """Start another node of the script's name; the master shuts the first one down."""
    subprocess.run([sys.executable, "-c", SECOND_NODE], check=True, timeout=LIMIT)


@pytest.mark.parametrize(
    ("ending", "end", "status"),
    [
        ("rospy.spin()", ctrl_c, 0),
        (SWALLOWING, ctrl_c_twice, 1),
        ("rospy.spin()", kill_node, 0),
        ("fleet.wait(1e6)", kill_node, 1),
        ("fleet.wait(1e6)", start_second_node, 1),
        ("fleet.wait(1.0); rospy.signal_shutdown('enough')", lambda process: None, 0),
    ],
)
def test_however_ros_is_shut_down_the_mission_lands_before(tmp_path, ending, end, status):
    path, flies = written(tmp_path, SHUT_DOWN.format(ending=ending)), tmp_path / "flies"
    arguments = [flies, f"__name:={NODE[1:]}"]
    with recorded(["cf1", "cf2"]) as tracks, script(path, *arguments) as process:
        try:
            peer.wait_until(flies.exists, "takeoff", LIMIT)
            assert all(track[-1][2] > 0.6 for track in tracks.values())
            end(process)
            _, errors = process.communicate(timeout=LIMIT)
        finally:
            process.kill()
        # Later the fleet's process would land them, as it does when a script is killed.
        assert landed(tracks), errors
    assert "MAY STILL FLY" not in errors
    assert process.returncode == status, errors


def test_a_mission_whose_terminal_is_closed_lands(tmp_path):
    path, flies = written(tmp_path, SHUT_DOWN.format(ending="fleet.wait(1e6)")), tmp_path / "flies"
    with recorded(["cf1", "cf2"]) as tracks, script(path, flies) as process:
        try:
            peer.wait_until(flies.exists, "takeoff", LIMIT)
            # From now on, whatever the script logs fails.
            process.stderr.close()
            process.send_signal(signal.SIGHUP)
            process.wait(LIMIT)
        finally:
            process.kill()
        assert landed(tracks)


ONE = """
from crazyflie_mission_api import Fleet

with Fleet({names}) as fleet:
    fleet.takeoff(0.8)
    fleet.wait({seconds})
"""


def test_a_second_mission_for_a_vehicle_is_refused_until_the_first_has_ended(tmp_path):
    first = written(tmp_path, ONE.format(names=["cf1", "cf2"], seconds=1e6))
    second = tmp_path / "second.py"
    second.write_text(ONE.format(names=["cf2"], seconds=0.0))
    with recorded(["cf1", "cf2"]) as tracks, script(first, "__name:=flier") as process:
        try:
            peer.wait_until(lambda: all(t[-1][2] > 0.7 for t in tracks.values()), "takeoff", LIMIT)
            # Of its name, it would make the master shut the first one down.
            status, errors = run(second, "__name:=flier")
            assert status == 1
            assert "/flier" in errors
            status, errors = run(second)
            assert status == 1
            assert re.search(r"cf2: in use by the running mission mission_\w+", errors), errors
            assert all(track[-1][2] > 0.7 for track in tracks.values())
        finally:
            process.kill()
        peer.wait_until(lambda: landed(tracks), "landing by the fleet", LIMIT)
        # One that was killed has left nothing behind.
        status, errors = run(second)
        assert status == 0, errors
        assert landed(tracks)


def test_a_script_for_the_sdk_flies_a_simulated_vehicle(tmp_path):
    with recorded(["cf1"]) as tracks:
        x, y, _ = tracks["cf1"][-1]
        status, errors = run(written(tmp_path, OLD))
        assert (status, errors) == (0, "")
        assert landed(tracks)
    assert tracks["cf1"][-1] == pytest.approx([x + 0.5, y - 0.5, 0.0], abs=0.16)


KILLED = """
from crazyflie_mission_api import Fleet

with Fleet(["cf1", "cf2"]) as fleet:
    fleet.takeoff(0.8)
    fleet["cf2"].go_to((0.0, 0.0, 1.0), relative=True)
    x, y, _ = fleet.position("cf1")
    fleet["cf2"].go_to((x, y, 1.8))
    fleet.wait(1e6)
"""


@pytest.mark.long
def test_the_fleet_lands_the_vehicles_of_a_script_that_is_killed(tmp_path):
    with recorded(["cf1", "cf2"]) as tracks, script(written(tmp_path, KILLED)) as process:
        try:
            peer.wait_until(
                lambda: (
                    abs(tracks["cf2"][-1][2] - 1.8) < 0.1
                    and math.dist(tracks["cf1"][-1][:2], tracks["cf2"][-1][:2]) < 0.1
                ),
                "one above the other",
                LIMIT,
            )
        finally:
            process.kill()
        peer.wait_until(lambda: landed(tracks), "landing", LIMIT)
    assert math.dist(tracks["cf1"][-1], tracks["cf2"][-1]) > 0.25
