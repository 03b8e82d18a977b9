"""A flight on simulated time: behind a box that goes and comes; then the sensors fail."""

import numpy as np
import pytest
import rospy
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import Reconfigure
from geometry_msgs.msg import PoseStamped

from crazyflie_reports.flight_operator import ready_operator
from crazyflie_utils.testing import peer

BOX_FRONT = 0.15  #: From the box's middle, m.


@pytest.fixture(scope="module")
def flight():
    """Fly once: times, vehicle's and box's x until the sensors fail; positions from then on."""
    with (
        ready_operator() as operator,
        peer.listening("/world/box/pose", PoseStamped) as poses,
    ):
        operator.takeoff()
        poses.drain()
        track = []
        farthest = x = 0.0
        # There and back, until the vehicle is backing off.
        while farthest < 0.5 or x > farthest - 0.15:
            pose = poses.next()
            x = operator.position[0]
            farthest = max(farthest, x)
            track.append((pose.header.stamp.to_sec(), x, pose.pose.position.x))
            assert track[-1][0] - track[0][0] < 16.0, "it has not backed off"
        rospy.ServiceProxy("/simulated_ranger/set_parameters", Reconfigure)(
            encode_config({"enabled": False})
        )
        places = [operator.position.copy()]
        for _ in range(3):
            operator.hover(0.7)
            places.append(operator.position.copy())
        operator.land()
        yield np.array(track), np.array(places)


def test_follows_within_its_distances(flight):
    time, vehicle, box = flight[0].T
    distance = box - BOX_FRONT - vehicle
    assert box.max() == pytest.approx(1.5, abs=0.01)
    assert 0.65 < vehicle.max() < 1.0
    assert 0.2 < distance.min() < 0.35
    assert 0.55 < distance.max() < 0.8
    away = (time - time[0] > 3.5) & (time - time[0] < 6.5)
    assert np.all(np.abs(distance[away] - 0.62) < 0.15)


def test_does_not_leave_its_line(flight):
    places = flight[1]
    assert np.abs(places[:, 1]).max() < 0.05
    assert places[:, 2] == pytest.approx(1.0, abs=0.05)


def test_stands_still_when_the_sensor_is_silent(flight):
    places = flight[1]
    # At 0.3 m/s: 0.15 s of silence, braking, and what the controller lags behind.
    assert np.linalg.norm(places[-1] - places[0]) < 0.2
    assert np.linalg.norm(places[-1] - places[-2]) < 0.03
