"""The visualizer in a process of its own, on a real master."""

import queue

import rospy
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_msgs.msg import PositionVelocityState, PositionVelocityStateStamped

LIMIT = 10.0


def test_whoever_comes_late_sees_path_and_reference():
    reference = rospy.Publisher("/ref", PositionVelocityStateStamped, latch=True, queue_size=1)
    reference.publish(PositionVelocityStateStamped(state=PositionVelocityState(z=3.5)))
    early = queue.Queue()
    subscriber = rospy.Subscriber("/visualizer/markers", MarkerArray, early.put)
    while True:
        markers = {marker.ns: marker for marker in early.get(timeout=LIMIT).markers}
        if markers["path"].points and markers["reference"].action == Marker.ADD:
            break
    subscriber.unregister()
    late = rospy.wait_for_message("/visualizer/markers", MarkerArray, LIMIT)
    markers = {marker.ns: marker for marker in late.markers}
    (point,) = markers["path"].points
    assert (point.x, point.y, point.z) == (1.0, 2.0, 3.0)
    assert markers["reference"].points[0].z == 3.5
    assert {marker.header.frame_id for marker in late.markers} == {"world"}
