"""A flight on simulated time: behind a box that goes and comes; then the sensor is silent."""

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import Range

from crazyflie_dev.flight_operator import ready_operator
from crazyflie_utils.testing import peer

BOX_FRONT = 0.15
"""From the box's middle, m."""


@pytest.fixture(scope="module")
def flight():
    """Fly once: times, vehicle's x and the box's x until the silence; positions after it."""
    with (
        ready_operator() as operator,
        peer.listening("/world/box/pose", PoseStamped) as poses,
    ):
        outside = rospy.Publisher("/outside/front", Range, queue_size=1)
        relay = rospy.Subscriber("/range/front", Range, outside.publish, tcp_nodelay=True)
        operator.takeoff()
        poses.drain()
        track = []
        # There and, until the vehicle has begun to back off, back again.
        while not track or track[-1][0] - track[0][0] < 29.0:
            pose = poses.next()
            x = pose.pose.position.x
            track.append((pose.header.stamp.to_sec(), operator.position[0], x))
        relay.unregister()
        silenced = operator.position.copy()
        places = []
        for _ in range(4):
            operator.hover(0.5)
            places.append(operator.position.copy())
        operator.land()
        yield np.array(track), silenced, np.array(places)


def test_follows_within_its_distances(flight):
    time, vehicle, box = flight[0].T
    distance = box - BOX_FRONT - vehicle
    assert box.max() == pytest.approx(2.1, abs=0.01)
    assert vehicle.max() == pytest.approx(1.35, abs=0.15)
    assert 0.2 < distance.min() < 0.35
    assert 0.5 < distance.max() < 0.8
    # It waits while the box does, and has caught up when it stands still.
    away = (time - time[0] > 5.0) & (time - time[0] < 12.5)
    assert np.all(np.abs(distance[away] - 0.65) < 0.12)


def test_does_not_leave_its_line(flight):
    places = flight[2]
    assert np.abs(places[:, 1]).max() < 0.05
    assert places[:, 2] == pytest.approx(1.0, abs=0.05)


def test_stands_still_when_the_sensor_is_silent(flight):
    _, silenced, places = flight
    # At 0.3 m/s: 0.15 s of silence, braking, and what the controller lags behind.
    assert np.linalg.norm(places[-1] - silenced) < 0.15
    assert np.linalg.norm(places[-1] - places[-2]) < 0.03
