"""The command identify, on bags."""

import dataclasses
import math

import numpy as np
import pytest
import rosbag
import rospy
from excited_flights import KIND, drawn, fly
from geometry_msgs.msg import TransformStamped, Twist, Vector3
from tf2_msgs.msg import TFMessage

from crazyflie_identification.command import main
from crazyflie_identification.recording import of_bag
from crazyflie_lqr.linear_feedback_node import GAINS
from crazyflie_model.angles import quaternion_from_zyx
from crazyflie_utils.parameters import vehicle_model

from test_fit import DEFAULT  # isort: skip

BEGIN = 1_700_000_000.0  #: Time of the first message, s.


def write(path, recording, late=0.004):
    """Write a bag as a flight with hw_hover.launch leaves it; poses arrive ``late``, s."""
    with rosbag.Bag(str(path), "w") as bag:
        for time, (roll, pitch, yaw_dot, pwm) in zip(
            recording.command_times, recording.commands, strict=True
        ):
            degrees = np.degrees([roll, pitch, yaw_dot])
            twist = Twist(linear=Vector3(degrees[1], degrees[0], pwm))
            twist.angular.z = -degrees[2]
            bag.write("/crazyflie/cmd_vel", twist, rospy.Time.from_sec(BEGIN + time))
        for time, (x, y, z, *rpy) in zip(recording.pose_times, recording.poses, strict=True):
            pose = TransformStamped(child_frame_id="crazyflie")
            pose.header.frame_id, pose.header.stamp = "world", rospy.Time.from_sec(BEGIN + time)
            pose.transform.translation = Vector3(x, y, z)
            q = pose.transform.rotation
            q.x, q.y, q.z, q.w = quaternion_from_zyx(*rpy)
            bag.write("/tf", TFMessage([pose]), rospy.Time.from_sec(BEGIN + time + late))


@pytest.fixture(scope="module")
def vehicle():
    """Return a vehicle that is late and heavy."""
    return drawn(7)


def turned(recording, yaw):
    """Return the same flight with another heading."""
    c, s = np.cos(yaw), np.sin(yaw)
    poses = recording.poses.copy()
    poses[:, :2] = recording.poses[:, :2] @ np.array([[c, s], [-s, c]])
    poses[:, 5] += yaw
    return dataclasses.replace(recording, poses=poses)


@pytest.fixture(scope="module")
def recording(vehicle):
    """Return an excited flight of it, with any heading."""
    return turned(fly(vehicle, DEFAULT, duration=22.0)[0], 2.0)


@pytest.fixture(scope="module")
def bag(tmp_path_factory, recording):
    """Return the bag of the flight."""
    path = tmp_path_factory.mktemp("bags") / "flight.bag"
    write(path, recording)
    return path


def test_roll_and_pitch_are_those_in_the_heading_frame(bag, recording):
    found = of_bag(bag, KIND)
    times = recording.pose_times + BEGIN
    for k in (3, 4, 5):
        expected = np.interp(found.pose_times, times, recording.poses[:, k])
        np.testing.assert_allclose(found.poses[:, k], expected, atol=1e-4)


def test_commands_that_are_not_finite_are_left_out(recording, bag, tmp_path):
    commands = recording.commands.copy()
    commands[[700, 800, 900, 1000], range(4)] = math.nan, math.inf, -math.inf, math.nan
    path = tmp_path / "flight.bag"
    write(path, dataclasses.replace(recording, commands=commands))
    good, found = of_bag(bag, KIND), of_bag(path, KIND)
    kept = np.delete(good.commands, [700, 800, 900, 1000], axis=0)
    np.testing.assert_allclose(found.commands, kept)
    assert len(found.command_times) == len(kept)


def test_a_bag_becomes_a_model_that_can_be_flown(bag, vehicle, tmp_path, capsys):
    out = tmp_path / "mine.yaml"
    assert main([str(bag), "--type", "cf21_markers", "--out", str(out)]) == 0
    model = vehicle_model.load(str(out))
    assert model.mass == pytest.approx(vehicle.mass, rel=0.02)
    assert model.delay == pytest.approx(vehicle.delay, abs=0.005)
    assert model.pitch_trim == pytest.approx(vehicle.pitch_trim, abs=0.002)
    printed = capsys.readouterr().out
    assert "roll lag" in printed and "+-" in printed and f"model:={out}" in printed
    page = (tmp_path / "mine.html").read_text()
    assert page.count('id="measured ') == page.count('id="predicted ') == 6
    assert "standard errors" in page
    assert "standard_errors" in out.read_text()
    # The controller takes it for its gains.
    assert GAINS(str(out)).shape == (4, 7)


def test_what_is_no_flight_is_refused_and_nothing_is_written(bag, tmp_path, capsys):
    out = tmp_path / "mine.yaml"
    short = tmp_path / "short.bag"
    recording, _ = fly(KIND, DEFAULT, duration=6.0)
    write(short, recording)
    for arguments, reason in (
        ([str(short)], "flight has 5.0 s of poses and commands; expected at least 15 s"),
        ([str(tmp_path / "none.bag")], "none.bag"),
        ([str(bag), "--vehicle", "cf9"], "has no vehicle cf9; expected one of crazyflie"),
    ):
        assert main([*arguments, "--out", str(out)]) == 1
        error = capsys.readouterr().err
        assert error.startswith("identify: ")
        assert reason in error
    assert not out.exists()
    with pytest.raises(SystemExit):
        main([str(bag), "--type", "bolt"])
