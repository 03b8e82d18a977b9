"""A flight by simulated time, on a real master."""

import numpy as np
import pytest
import rospy
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.testing.peer import listening


def test_flies_by_simulated_time():
    publisher = rospy.Publisher("/control/final", ControlStamped, queue_size=1)
    stamps, heights = [], []
    with listening("/tf", TFMessage) as received:
        while len(heights) < 100:
            transform = received.next().transforms[0]
            publisher.publish(ControlStamped(control=Control(thrust=10.81)))
            if transform.transform.translation.z > 0.0:
                stamps.append(transform.header.stamp.to_sec())
                heights.append(transform.transform.translation.z)
    # 1 m/s^2 by the stamps, whatever the machine's clock.
    acceleration = 2.0 * np.polyfit(np.array(stamps) - stamps[0], heights, 2)[0]
    assert acceleration == pytest.approx(1.0, rel=1e-3)
