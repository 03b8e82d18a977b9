"""An estimator in a process of its own, on a real master."""

import math
import queue

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_msgs.msg import (
    FullStateStamped,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils.testing.peer import listening
from crazyflie_utils.vectors import to_vector

PERIOD = 0.01
STAMP_ERROR = 200e-9  # tf2's Python buffer keeps stamps as float seconds
MESSAGE_TYPES = {
    6: PositionVelocityStateStamped,
    7: PositionVelocityYawStateStamped,
    12: FullStateStamped,
}
SIGNALS = ("x", "y", "z", "roll", "pitch", "yaw")
START = np.array([1.0, 2.0, 3.0, 0.1, -0.2, 3.1])
RATE = np.array([0.5, -1.0, 0.25, 0.02, -0.01, 0.3])


@pytest.fixture
def states():
    """Return a queue of what the estimator publishes."""
    message_type = MESSAGE_TYPES[rospy.get_param("/state_estimator/x_dim")]
    with listening("/state", message_type) as states:
        yield states


def pose(elapsed, stamp):
    """Return where a vehicle is that moves and turns evenly."""
    signals = START + RATE * elapsed
    message = TransformStamped(child_frame_id="crazyflie")
    message.header.frame_id = "world"
    message.header.stamp = stamp
    message.transform.translation = Vector3(*map(float, signals[:3]))
    message.transform.rotation = Quaternion(*quaternion_from_rpy(*signals[3:]))
    return message


def expected(elapsed):
    """Return name -> value of every field that a state may have."""
    signals = START + RATE * elapsed
    signals[3:] = [math.remainder(angle, 2.0 * math.pi) for angle in signals[3:]]
    values = dict(zip(SIGNALS, signals, strict=True))
    return values | {f"{name}_dot": rate for name, rate in zip(SIGNALS, RATE, strict=True)}


def test_even_motion_is_estimated_exactly(states):
    publisher = rospy.Publisher("/tf", TFMessage, queue_size=1)
    start = rospy.Time.now()
    messages = []
    for count in range(1, 1001):
        elapsed = count * PERIOD
        publisher.publish(TFMessage([pose(elapsed, start + rospy.Duration(elapsed))]))
        try:
            messages.append(states.get(timeout=PERIOD))
        except queue.Empty:
            continue
        if len(messages) == 20:
            break
    assert len(messages) == 20
    for message in messages:
        elapsed = (message.header.stamp - start).to_sec()
        assert elapsed == pytest.approx(round(elapsed / PERIOD) * PERIOD, abs=STAMP_ERROR)
        assert message.header.frame_id == "world"
        values = expected(elapsed)
        np.testing.assert_allclose(
            to_vector(message.state),
            [values[name] for name in message.state.__slots__],
            atol=2 * STAMP_ERROR / PERIOD,
        )
