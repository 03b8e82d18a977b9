"""A simulator as the source of simulated time, as fast as it can, on a real master."""

import numpy as np
import pytest
import rospy
from rosgraph_msgs.msg import Clock

from crazyflie_utils.testing.peer import listening


@pytest.fixture
def clocks():
    """Return a queue of what comes on /clock."""
    with listening("/clock", Clock) as clocks:
        yield clocks


def test_time_passes_in_time_steps(clocks):
    times = [clocks.next().clock.to_sec() for _ in range(500)]
    # Messages may be lost on the way, the steps between the others may not.
    steps = np.diff(times) / 0.01
    assert steps.min() > 0.99
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert rospy.get_time() >= times[-1]


def test_a_minute_passes_in_seconds(clocks):
    begin = now = clocks.next().clock.to_sec()
    while now < begin + 60.0:
        later = clocks.next().clock.to_sec()
        assert later > now
        now = later
