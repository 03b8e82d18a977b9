"""Scripts that users start or write, each flying a virtual vehicle."""

import signal
import subprocess
import sys

import numpy as np
import pytest
import rosnode
from flights import LIMIT, node, observed_vehicle

from crazyflie_demo.trajectory_file import save
from crazyflie_model.polynomials import PolynomialPiece, hermite

# Plays a script as users write it: a command returns at once, so the script sleeps as long as
# the command takes. That is what users' scripts do, so it is what has to work.
SCRIPT = """
import sys
import numpy as np
import rospy
import uav_trajectory
from crazyflie import Crazyflie

rospy.init_node("script")
cf = Crazyflie("crazyflie", "/crazyflie")
cf.setParam("commander/enHighLevel", 1)
assert cf.getParam("commander/enHighLevel") == 1
trajectory = uav_trajectory.Trajectory()
trajectory.loadcsv(sys.argv[1])
cf.uploadTrajectory(0, 0, trajectory)
cf.takeoff(targetHeight=0.5, duration=1.5)
rospy.sleep(2.0)
cf.goTo(goal=[0.4, 0.0, 0.0], yaw=0.0, duration=1.5, relative=True)
rospy.sleep(2.0)
cf.startTrajectory(0, timescale=1.0)
rospy.sleep(trajectory.duration + 0.5)
assert 3.0 < cf.getVoltage() < 4.3
cf.land(targetHeight=0.0, duration=1.5)
rospy.sleep(2.0)
cf.stop()
"""


@pytest.fixture(scope="module")
def observer():
    """Return an observer of a vehicle that the driver knows as /crazyflie."""
    with observed_vehicle() as observer:
        yield observer


def piece(duration, *ends):
    """Return a piece from rest to rest; for each axis where it begins and ends."""
    axes = [hermite([begin, 0.0, 0.0, 0.0], [end, 0.0, 0.0, 0.0], duration) for begin, end in ends]
    return PolynomialPiece(duration, *axes, [0.0] * 8)


def flown(observer, flight):
    """Return the positions of a flight, from 0.2 m up to the ground again."""
    observer.track_until(lambda truth: truth.position[2] > 0.2 or flight.poll() is not None)
    assert flight.poll() is None, "the script has ended before it flew; its output has the reason"
    track = observer.track_until(lambda truth: truth.position[2] < 0.02)
    assert flight.wait(LIMIT) == 0
    return np.array([truth.position for truth in track])


def fly(observer, script, *arguments):
    with node("crazyflie_demo", script, *arguments) as flight:
        return flown(observer, flight)


def test_hover(observer):
    path = fly(observer, "Hover.py")
    assert path[:, 2].max() == pytest.approx(0.4, abs=0.08)
    np.testing.assert_allclose(path[-1, :2] - path[0, :2], [0.4, 0.2], atol=0.15)


def test_position(observer):
    x, y, _ = at_rest(observer)
    path = fly(observer, "Position.py", "__ns:=crazyflie", f"_x:={x:.3f}", f"_y:={y:.3f}")
    np.testing.assert_allclose(path.max(axis=0), [x + 0.2, y + 0.2, 0.4], atol=0.1)
    np.testing.assert_allclose(path[-1, :2], [x, y], atol=0.1)


@pytest.mark.parametrize("script", ["Position.py", "Hover.py"])
def test_a_stream_that_is_interrupted_ends_with_a_landing(observer, script):
    x, y, _ = at_rest(observer)
    where = ("__ns:=crazyflie", f"_x:={x:.3f}", f"_y:={y:.3f}")
    arguments = where if script == "Position.py" else ()
    with node("crazyflie_demo", script, *arguments) as flight:
        observer.track_until(lambda truth: truth.position[2] > 0.3)
        flight.send_signal(signal.SIGINT)
        track = observer.track_until(lambda truth: truth.position[2] < 0.02)
        assert flight.wait(LIMIT) == 0
    # A fall from there would end with 2.4 m/s.
    assert min(truth.velocity[2] for truth in track) > -1.0


def test_a_streamed_trajectory(observer, tmp_path):
    x, y, _ = at_rest(observer)
    pieces = [
        piece(2.0, (x, x), (y, y), (0.0, 0.6)),
        piece(2.0, (x, x), (y, y - 0.5), (0.6, 0.6)),
        piece(2.5, (x, x), (y - 0.5, y - 0.5), (0.6, 0.0)),
    ]
    save(tmp_path / "flight.csv", pieces)
    path = fly(observer, "execute_trajectory.py", tmp_path / "flight.csv")
    assert path[:, 2].max() == pytest.approx(0.6, abs=0.08)
    np.testing.assert_allclose(path[-1, :2], [x, y - 0.5], atol=0.1)


def test_a_script_of_a_user(observer, tmp_path):
    x, y, _ = at_rest(observer)
    # The landing that ends a stream takes 2 s, in which the firmware refuses a takeoff.
    landed = observer.track_until(lambda truth: True)[-1].time
    observer.track_until(lambda truth: truth.time > landed + 2.0)
    (tmp_path / "script.py").write_text(SCRIPT)
    save(tmp_path / "aside.csv", [piece(2.0, (0.0, 0.0), (0.0, 0.4), (0.0, 0.0))])
    command = [sys.executable, tmp_path / "script.py", tmp_path / "aside.csv"]
    with subprocess.Popen(command, cwd=tmp_path) as flight:
        try:
            path = flown(observer, flight)
        finally:
            flight.kill()
    assert path[:, 2].max() == pytest.approx(0.5, abs=0.08)
    np.testing.assert_allclose(path[-1, :2], [x + 0.4, y + 0.4], atol=0.1)


FLYING = """
import pathlib, sys, rospy
from crazyflie import Crazyflie

rospy.init_node("script")
cf = Crazyflie("crazyflie", "/crazyflie")
cf.takeoff(targetHeight=0.5, duration=1.5)
rospy.sleep(2.0)
pathlib.Path(sys.argv[1]).touch()
"""
STREAM = """
while not rospy.is_shutdown():
    cf.cmdVelocityWorld([0.0, 0.0, 0.0], 0.0)
    rospy.sleep(0.05)
"""


def kill_node(_):
    """Ask the script's node to shut down, in a thread of rospy, as rosnode kill does."""
    assert rosnode.kill_nodes(["/script"]) == (["/script"], [])


@pytest.mark.parametrize(
    ("ending", "end", "status"),
    [
        ("", None, 0),
        ("1 / 0", None, 1),
        ("rospy.spin()", lambda flight: flight.send_signal(signal.SIGINT), 0),
        (STREAM, lambda flight: flight.send_signal(signal.SIGTERM), 0),
        ("while True: cf.goTo([0.0, 0.0, 0.5], 0.0, 1.0)", kill_node, 1),
    ],
)
def test_a_vehicle_is_landed_at_the_end_of_a_script(observer, tmp_path, ending, end, status):
    # A landing that ends a stream takes 2 s, in which the firmware refuses a takeoff.
    at_rest(observer)
    landed = observer.track_until(lambda truth: True)[-1].time
    observer.track_until(lambda truth: truth.time > landed + 2.5)
    script, flies = tmp_path / "script.py", tmp_path / "flies"
    script.write_text(FLYING + ending)
    with subprocess.Popen([sys.executable, script, flies]) as flight:
        try:
            observer.track_until(lambda truth: flies.exists() or flight.poll() is not None)
            assert flies.exists()
            if end is not None:
                end(flight)
            track = observer.track_until(lambda truth: truth.position[2] < 0.02)
            assert flight.wait(LIMIT) == status
        finally:
            flight.kill()
    assert track[0].position[2] > 0.3
    assert min(truth.velocity[2] for truth in track) > -1.0


def at_rest(observer):
    """Return where the vehicle stands."""
    truths = observer.track_until(
        lambda truth: truth.position[2] < 0.01 and np.linalg.norm(truth.velocity) < 0.01
    )
    return truths[-1].position
