"""ROS interface of a flight from waypoint to waypoint, and the waypoints of the demos."""

from geometry_msgs.msg import PoseStamped
from typing_extensions import override

from crazyflie_controller.pose_source import PoseParameters, PoseSource
from crazyflie_demo.node_parts import GoalParameters, goal_message
from crazyflie_demo.waypoints import WAYPOINTS, Waypoint, WaypointFollower
from crazyflie_utils import Node, NodeHandle, parameter
from crazyflie_utils.parameters.types import Number


class WaypointParameters(GoalParameters, PoseParameters):
    """Parameters of `DemoNode`."""

    waypoints: list[Waypoint] | None = parameter(
        WAYPOINTS, "waypoints; by default the demo's own", None
    )
    position_tolerance: float = parameter(
        Number("m", above=0.0),
        "distance at which a waypoint is reached",
        0.3,
        "tolerance/position",
        live=True,
    )
    yaw_tolerance: float = parameter(
        Number("rad", above=0.0),
        "error of the heading at which a waypoint is reached",
        0.2,
        "tolerance/yaw",
        live=True,
    )


class DemoNode(Node[WaypointParameters]):
    """Publish waypoints as goals, one after the other; these are a square."""

    #: Default of the parameter ``waypoints``.
    waypoints: tuple[Waypoint, ...] = (
        Waypoint(0.0, 0.0, 0.5, 0.0, 2.0),
        Waypoint(0.5, 0.5, 0.5, 0.0, 1.0),
        Waypoint(0.5, -0.5, 0.5, 0.0, 1.0),
        Waypoint(-0.5, -0.5, 0.5, 0.0, 1.0),
        Waypoint(-0.5, 0.5, 0.5, 0.0, 1.0),
        Waypoint(0.0, 0.0, 0.5, 0.0, 0.0),
    )

    def __init__(self) -> None:
        self._stamp: float | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._follower = WaypointFollower(self._parameters.waypoints or list(self.waypoints))
        self._publisher = handle.publisher("goal", PoseStamped)
        self._source = PoseSource(handle, self._parameters)
        handle.timer(1.0 / self._parameters.rate, self._on_timer)

    def _on_timer(self):
        follower, parameters = self._follower, self._parameters
        index, was_finished = follower.index, follower.is_finished
        stamp, pose = self._source.latest()
        if pose is not None and stamp != self._stamp:
            self._stamp = stamp
            tolerances = parameters.position_tolerance, parameters.yaw_tolerance
            follower.update(self._handle.time(), pose[:3], pose.yaw, tolerances)
        if follower.index != index:
            self._handle.info(f"next is waypoint {follower.index}: {list(follower.goal)}")
        if follower.is_finished and not was_finished:
            self._handle.info("finished; the last waypoint remains the goal")
        x, y, z, yaw, _ = follower.goal
        self._publisher.publish(
            goal_message(self._handle.stamp(), parameters.world_frame, x, y, z, yaw)
        )


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
    """The second of two vehicles that fly together: x < 0, the path of the first one, reflected."""

    waypoints = tuple(Waypoint(-x, -y, z, yaw, s) for x, y, z, yaw, s in Demo1Node.waypoints)
