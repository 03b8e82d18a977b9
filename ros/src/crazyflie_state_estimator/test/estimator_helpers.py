"""An estimator node on a fake process, and poses for it."""

from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from tf2_msgs.msg import TFMessage

from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_state_estimator.estimator_node import PositionVelocityYawStateEstimatorNode
from crazyflie_utils.testing import FakeProcess

PARAMETERS = {
    "x_dim": 7,
    "time_step": 0.01,
    "frames/fixed": "world",
    "frames/robot": "crazyflie",
    "topics/state": "/state",
}


def launch(node_class=PositionVelocityYawStateEstimatorNode, **changes):
    """Return a process with an estimator in it."""
    process = FakeProcess()
    assert process.launch(node_class(), "/state_estimator", {**PARAMETERS, **changes})
    return process


def transform(process, position=(0.0, 0.0, 0.0), attitude=(0.0, 0.0, 0.0), frame="crazyflie"):
    """Return a transform that is stamped now."""
    message = TransformStamped(child_frame_id=frame)
    message.header.frame_id = "world"
    message.header.stamp = process.clock.stamp()
    message.transform.translation = Vector3(*position)
    message.transform.rotation = Quaternion(*quaternion_from_rpy(*attitude))
    return message


def fly(process, position, duration, period=0.01):
    """Broadcast ``position(elapsed)`` every period, each followed by a tick of the node."""
    for k in range(round(duration / period)):
        pose = transform(process, *position(k * period))
        process.publish("/tf", TFMessage([pose]))
        process.advance(period)


def moving(elapsed):
    return (1.0 + elapsed, -2.0 * elapsed, 0.5 * elapsed), (0.1, -0.2, 3.0 + elapsed)
