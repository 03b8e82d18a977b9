"""Motion capture of others to a vehicle's estimator."""

import pytest
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from std_msgs.msg import Header

from crazyflie_demo.external_nodes import (
    ExternalPoseViconNode,
    ExternalPositionViconNode,
    ExternalPositionVrpnNode,
)
from crazyflie_utils.testing import FakeProcess

HEADER = Header(frame_id="/world")
POINT, ROTATION = (1.0, -2.0, 0.5), (0.0, 0.6, 0.0, 0.8)


def vicon(x=POINT[0]):
    transform = Transform(Vector3(x, *POINT[1:]), Quaternion(*ROTATION))
    return TransformStamped(HEADER, "cf", transform)


def vrpn(x=POINT[0]):
    return PoseStamped(HEADER, Pose(Point(x, *POINT[1:]), Quaternion(*ROTATION)))


@pytest.mark.parametrize(
    ("node", "measurement", "output"),
    [
        (ExternalPoseViconNode, vicon, "pose"),
        (ExternalPositionViconNode, vicon, "point"),
        (ExternalPositionVrpnNode, vrpn, "point"),
    ],
)
def test_passes_on_what_is_finite(node, measurement, output):
    process = FakeProcess()
    topic = "/vicon/cf/cf"
    assert process.launch(node(), "/crazyflie/external", {"topic": topic})
    process.publish(topic, measurement())
    process.publish(topic, measurement(float("nan")))
    name = {"pose": "external_pose", "point": "external_position"}[output]
    (message,) = process.published(f"/crazyflie/{name}")
    assert message.header == HEADER
    if output == "pose":
        assert message.pose == vrpn().pose
    else:
        assert message.point == Point(*POINT)


def test_the_topic_is_required():
    process = FakeProcess()
    assert not process.launch(ExternalPoseViconNode(), "/external")
    assert "/external/topic is not set" in process.logged("error")[0]
