"""Sixteen vehicles fly into a lattice, into a ring, and back, all at the same time."""

import contextlib
import runpy
from pathlib import Path

import numpy as np
import pytest
import rospkg
import rospy
from flown import run
from scipy.spatial.distance import cdist, pdist
from tf2_msgs.msg import TFMessage

from crazyflie_utils.testing import peer

EXAMPLE = Path(rospkg.RosPack().get_path("crazyflie_mission_api")) / "examples/lattice.py"
N = 16

EVERY = 10  #: Ticks of the simulation, of 10 ms, from one that is looked at to the next.


@contextlib.contextmanager
def recorded():
    """Record where all are, m: lists of N positions, in the order of their frames."""
    places = []
    count = 0

    def note(message):
        nonlocal count
        count += 1
        if count % EVERY:
            return
        found = TFMessage().deserialize(message._buff).transforms
        vehicles = sorted(
            (transform.child_frame_id, transform.transform.translation)
            for transform in found
            if "/" not in transform.child_frame_id
        )
        if len(vehicles) == N:
            places.append([(place.x, place.y, place.z) for _, place in vehicles])

    subscriber = rospy.Subscriber("/tf", rospy.AnyMsg, note, queue_size=1)
    peer.wait_until(lambda: places, "all vehicles on /tf")
    yield places
    subscriber.unregister()


@pytest.fixture(scope="module")
def flight():
    """Fly once; return where the vehicles were: positions by time and vehicle, m."""
    with recorded() as places:
        assert run(EXAMPLE, str(N), limit=180.0) == (0, "")
    return np.array(places)


@pytest.mark.parametrize("figure", ["cube", "ring"])
def test_all_are_in_their_figure_at_the_same_time(flight, figure):
    goals = runpy.run_path(str(EXAMPLE))[figure](N)
    assert min(cdist(goals, places).min(axis=1).max() for places in flight) < 0.15


def test_no_two_vehicles_meet(flight):
    assert min(pdist(places).min() for places in flight) > 0.5


def test_all_have_flown_and_land_where_one_of_them_stood(flight):
    assert cdist(flight[0], flight[-1]).min(axis=1).max() < 0.1
    assert np.ptp(flight[:, :, 2], axis=0).min() > 0.9
