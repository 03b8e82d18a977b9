"""Marker of the way that a vehicle is commanded to fly."""

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_model.trajectory import Trajectory
from crazyflie_utils import NodeHandle

_COLOUR = ColorRGBA(0.95, 0.55, 0.05, 0.8)
_WIDTH = 0.01  #: m.
_POINTS = 20  #: Per piece of a trajectory,
_MAX_POINTS = 200  #: and in all.


class PlanMarker:
    """Publishes a trajectory, in the fixed frame ``frame``, from its beginning to its end.

    The topic is latched, so that it is also seen by those who look later.
    """

    def __init__(self, handle: NodeHandle, topic: str, frame: str):
        self._frame = frame
        self._namespace = handle.name
        self._publisher = handle.publisher(topic, MarkerArray, latch=True)
        self._is_shown = False

    def show(self, trajectory: Trajectory) -> None:
        """Publish a trajectory; it replaces the last one."""
        count = min(_POINTS * len(trajectory.pieces), _MAX_POINTS)
        times = (trajectory.duration * k / count for k in range(count + 1))
        points = [Point(*trajectory.evaluate(time).position) for time in times]
        self._publish(Marker.ADD, points)
        self._is_shown = True

    def clear(self) -> None:
        """Take the trajectory away, if there is one."""
        if self._is_shown:
            self._publish(Marker.DELETE, [])
            self._is_shown = False

    def _publish(self, action, points):
        marker = Marker(ns=self._namespace, type=Marker.LINE_STRIP, action=action, points=points)
        marker.header.frame_id = self._frame
        marker.pose.orientation.w = 1.0
        marker.scale.x, marker.color = _WIDTH, _COLOUR
        self._publisher.publish(MarkerArray([marker]))
