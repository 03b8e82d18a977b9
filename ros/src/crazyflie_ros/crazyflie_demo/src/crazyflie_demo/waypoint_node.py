"""ROS interface of a tour from waypoint to waypoint, and the tours of the demos."""

from geometry_msgs.msg import PoseStamped

from crazyflie_demo.goals import goal_message
from crazyflie_demo.waypoints import Tour, Waypoint, WaypointList
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import FRAME, Number
from crazyflie_utils.runtime.transforms import TransformError


class DemoNode(Node):
    """Publish goals along a tour; this one goes round a square."""

    waypoints = (
        Waypoint(0.0, 0.0, 0.5, 0.0, 2.0),
        Waypoint(0.5, 0.5, 0.5, 0.0, 1.0),
        Waypoint(0.5, -0.5, 0.5, 0.0, 1.0),
        Waypoint(-0.5, -0.5, 0.5, 0.0, 1.0),
        Waypoint(-0.5, 0.5, 0.5, 0.0, 1.0),
        Waypoint(0.0, 0.0, 0.5, 0.0, 0.0),
    )
    """Where to go unless the parameter ``waypoints`` says otherwise."""

    def __init__(self):
        super().__init__()
        self._world_frame = None
        self._frame = None
        self._period = None
        self._tour = None
        self._stamp = None
        self._publisher = None
        self._lookup = None

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._world_frame = handle.param("worldFrame", FRAME, "world")
        self._frame = handle.param("frame", FRAME)
        self._period = 1.0 / handle.param("rate", Number("Hz", above=0.0, maximum=500.0), 30.0)
        self._tour = Tour(
            handle.param("waypoints", WaypointList(), list(self.waypoints)),
            handle.param("tolerance/position", Number("m", above=0.0), 0.3),
            handle.param("tolerance/yaw", Number("rad", above=0.0), 0.2),
        )

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher("goal", PoseStamped)
        self._lookup = handle.listen_to_transforms()
        handle.timer(self._period, self._on_timer)

    def _on_timer(self):
        index, was_finished = self._tour.index, self._tour.is_finished
        self._look()
        if self._tour.index != index:
            self._handle.info(f"goes on to waypoint {self._tour.index}: {list(self._tour.goal)}")
        if self._tour.is_finished and not was_finished:
            self._handle.info("the tour is finished; the last waypoint remains the goal")
        goal = self._tour.goal
        self._publisher.publish(
            goal_message(self._handle.stamp(), self._world_frame, goal.x, goal.y, goal.z, goal.yaw)
        )

    def _look(self):
        try:
            found = self._lookup(self._world_frame, self._frame)
        except TransformError as error:
            self._handle.warn(
                f"no pose of {self._frame} in {self._world_frame}: {error}", throttle=5.0, key="tf"
            )
            return
        if found.header.stamp == self._stamp:
            return
        self._stamp = found.header.stamp
        t, q = found.transform.translation, found.transform.rotation
        yaw = rpy_from_quaternion(q.x, q.y, q.z, q.w)[2]
        self._tour.see(self._handle.time(), (t.x, t.y, t.z), yaw)


class Demo1Node(DemoNode):
    """The first of two vehicles that fly together: x > 0."""

    waypoints = (
        Waypoint(0.5, 0.0, 0.5, 0.0, 2.0),
        Waypoint(0.5, 0.5, 0.5, 0.0, 1.0),
        Waypoint(1.0, 0.5, 0.8, 0.0, 1.0),
        Waypoint(1.0, -0.5, 0.8, 0.0, 1.0),
        Waypoint(0.5, -0.5, 0.5, 0.0, 1.0),
        Waypoint(0.5, 0.0, 0.5, 0.0, 0.0),
    )


class Demo2Node(DemoNode):
    """The second of two vehicles that fly together: x < 0, the first one's tour reflected."""

    waypoints = tuple(Waypoint(-x, -y, z, yaw, s) for x, y, z, yaw, s in Demo1Node.waypoints)
