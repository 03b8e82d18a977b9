"""A virtual vehicle that motion capture sees hovers at a goal that a joystick moves."""

import pytest
import rospy
import tf2_ros
import yaml
from flights import LIMIT, Stick, launched, node, virtual_vehicle, wait_for_service

from crazyflie_demo.joystick import LAND, PITCH, TAKEOFF
from crazyflie_utils.testing.peer import wait_until
from crazyflie_utils.testing.programs import free_port


class Positions:
    """Positions of vehicles as tf has them."""

    def __init__(self, *frames):
        self._frames = frames
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)

    def positions(self):
        """Return the position (x, y, z) of each."""
        transforms = [
            self._buffer.lookup_transform("world", frame, rospy.Time(), rospy.Duration(LIMIT))
            for frame in self._frames
        ]
        return [
            (t.transform.translation.x, t.transform.translation.y, t.transform.translation.z)
            for t in transforms
        ]

    def wait_until(self, is_it):
        """Wait until ``is_it(*positions)``."""
        try:
            wait_until(lambda: is_it(*self.positions()), "these positions")
        except AssertionError as error:
            raise AssertionError(f"{error}; in the end: {self.positions()}") from error


def virtual_mocap(command_port, observer_port):
    """Run motion capture that sees the virtual vehicles."""
    parameters = {"command_port": command_port, "observer/port": observer_port}
    return node("crazyflie_virtual", "virtual_mocap", **parameters)


def config(path, command_port, bodies):
    """Write a configuration of mocap_node for virtual vehicles; return its path."""
    path.write_text(
        yaml.safe_dump(
            {
                "rigid_bodies": {
                    str(number): {"child_frame_id": f"Robot_{number}/base_link"}
                    for number in range(1, bodies + 1)
                },
                "optitrack_config": {
                    "server_address": "127.0.0.1",
                    "command_port": command_port,
                },
            }
        )
    )
    return path


def test_hovers_goes_and_lands(tmp_path):
    command_port, observer_port = free_port(), free_port()
    with (
        Stick(tmp_path / "js0") as stick,
        virtual_mocap(command_port, observer_port),
        virtual_vehicle(**{"observer/port": observer_port}) as uri,
        launched(
            "crazyflie_demo",
            "hover_mocap.launch",
            uri=uri,
            joy_dev=tmp_path / "js0",
            mocap="true",
            goal_type="publish_pose_teleop.py",
            frame="Robot_1/base_link",
            mocap_config_file=config(tmp_path / "mocap.yaml", command_port, 1),
            z=0.6,
        ),
    ):
        tracked = Positions("Robot_1/base_link")
        wait_for_service("/crazyflie/controller/takeoff")
        wait_for_service("/crazyflie/emergency")
        assert tracked.positions()[0] == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
        stick.press(TAKEOFF)
        tracked.wait_until(lambda vehicle: vehicle[2] > 0.5)
        stick.tilt(PITCH, 1.0)
        tracked.wait_until(lambda vehicle: vehicle[0] > 0.4)
        stick.tilt(PITCH, 0.0)
        stick.press(LAND)
        tracked.wait_until(lambda vehicle: vehicle[2] < 0.01)
        assert tracked.positions()[0][1] == pytest.approx(0.0, abs=0.1)
