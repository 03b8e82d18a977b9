"""The visualizer in a process of its own, on a real master."""

import rospy
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped
from crazyflie_utils.testing.peer import LIMIT, listening


def test_a_late_subscriber_sees_path_and_reference():
    reference = rospy.Publisher("/ref", PositionVelocityStateStamped, latch=True, queue_size=1)
    reference.publish(PositionVelocityStateStamped(state=PositionVelocityState(z=3.5)))

    def is_complete(message):
        markers = {marker.ns: marker for marker in message.markers}
        return markers["path"].points and markers["reference"].action == Marker.ADD

    with listening("/visualizer/markers", MarkerArray) as early:
        early.next(is_complete)
    late = rospy.wait_for_message("/visualizer/markers", MarkerArray, LIMIT)
    markers = {marker.ns: marker for marker in late.markers}
    (point,) = markers["path"].points
    assert (point.x, point.y, point.z) == (1.0, 2.0, 3.0)
    assert markers["reference"].points[0].z == 3.5
    assert {marker.header.frame_id for marker in late.markers} == {"world"}
