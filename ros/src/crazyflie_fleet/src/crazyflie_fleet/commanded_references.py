"""References of a vehicle that flies by high-level commands, and the marker of its path."""

import copy
import math
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_fleet.follower import CommandFollower, Velocity
from crazyflie_fleet.high_level_services import HighLevelParameters, reference_message
from crazyflie_fleet.references_node import TrackedVehicle
from crazyflie_model.angles import Triple
from crazyflie_model.limits import LEVEL_AGE
from crazyflie_model.polynomials import Goal, at_rest
from crazyflie_model.trajectory import Trajectory
from crazyflie_msgs.msg import PositionVelocityYawStateStamped
from crazyflie_takeoff.motion import MAX_POSITION_AGE
from crazyflie_utils import NodeHandle
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.vectors import to_tuple

_COLOUR = ColorRGBA(0.95, 0.55, 0.05, 0.8)
_WIDTH = 0.01  #: Width of the line (m).
_POINTS = 20  #: Number of points of a piece of a trajectory.
_MAX_POINTS = 200  #: Largest number of points of a trajectory.

_HOLD_DURATION = 0.5  #: Duration of the move to the goal of the last setpoint (s).


class PlanMarker:
    """Publishes a trajectory, in the fixed frame ``frame``, from its beginning to its end.

    The topic is latched, for late subscribers.
    """

    def __init__(self, handle: NodeHandle, topic: str, frame: str):
        self._frame = frame
        self._namespace = handle.name
        self._publisher = handle.publisher(topic, MarkerArray, latch=True)
        self._is_shown = False

    def show(self, trajectory: Trajectory | None) -> None:
        """Publish a trajectory, which replaces the last one; None removes it."""
        if trajectory is None and not self._is_shown:
            return
        self._is_shown = trajectory is not None
        marker = Marker(ns=self._namespace, type=Marker.LINE_STRIP, action=Marker.DELETE)
        marker.header.frame_id = self._frame
        marker.pose.orientation.w = 1.0
        marker.scale.x, marker.color = _WIDTH, _COLOUR
        if trajectory is not None:
            marker.action = Marker.ADD
            count = min(_POINTS * len(trajectory.pieces), _MAX_POINTS)
            times = (trajectory.duration * k / count for k in range(count + 1))
            marker.points = [Point(*trajectory.evaluate(time).position) for time in times]
        self._publisher.publish(MarkerArray([marker]))


class CommandedReferences:
    """Publishes references while there is something to follow.

    A vehicle of a fleet is given; otherwise topics of the parameters are subscribed and published.
    """

    def __init__(
        self,
        handle: NodeHandle,
        parameters: HighLevelParameters,
        vehicle: TrackedVehicle | None,
    ):
        self._handle = handle
        self._parameters = parameters
        self.follower = CommandFollower()
        # Ends the timer, which runs while the goal moves and while setpoints come.
        self._stop_timer: Callable[[], None] | None = None
        self._state: Goal[float] | None = None
        self._state_time = 0.0
        self._vehicle = vehicle
        self._held_at: Triple | None = None  # Place from which a move that is held is to go on.
        self._plan = PlanMarker(handle, parameters.plan_topic, parameters.fixed_frame)
        if vehicle is None:
            reference_type = parameters.reference_type
            self._publisher = handle.publisher(parameters.reference_topic, reference_type)
            state_type = PositionVelocityYawStateStamped
            handle.subscribe(parameters.state_topic, state_type, self._on_state, finite="state")

    def present(self) -> Goal[float]:
        """Return the present state of the vehicle; raises `RefusalError` if it is not known."""
        measured = self._measured()
        if measured is None:
            topic = self._handle.resolve(self._parameters.state_topic)
            raise RefusalError(f"no state has come on {topic} for {MAX_POSITION_AGE:g} s")
        return measured

    def adopt(self, goal: Goal[float] | None) -> None:
        """Begin the next command at a goal of another node, unless there is a goal already."""
        now = self._handle.time()
        if goal is not None and self.follower.goal(now) is None:
            self.follower.take_setpoint(now, goal)

    def ahead(self, time: float) -> Triple | None:
        """Return the position of the references after a time (s), m; None if they do not move.

        A move that is held stands still at its beginning, which may be nearer to the other vehicle
        than this one is: whether it may go on depends on where it ends.
        """
        if self._stop_timer is None or self.follower.setpoint:
            return None
        if self.follower.is_move and self._present_hold() is not None:
            time = math.inf
        goal = self.follower.goal(self._handle.time() + time)
        return None if goal is None else goal.position

    def begin(self, command: Callable[..., None], *arguments: Any) -> None:
        """Begin a command of `CommandFollower`; raises `RefusalError`."""
        self.follower = self.planned(command, *arguments)
        self._run()

    def planned(self, command: Callable[..., None], *arguments: Any) -> CommandFollower:
        """Return the follower as a command of `CommandFollower` would make it."""
        present, follower = self.present(), copy.copy(self.follower)
        if (place := self._present_hold()) is not None:
            # Its present reference is there, at rest, and not at its goal.
            follower.forget()
            present = at_rest(place, present.yaw)
        command(follower, self._handle.time(), present, *arguments)
        return follower

    def take(self, setpoint: Goal[float] | Velocity, ground: float) -> None:
        """Follow a setpoint; heights of a velocity are above ``ground``, m."""
        now = self._handle.time()
        if isinstance(setpoint, Goal):
            self.follower.take_setpoint(now, setpoint)
        else:
            self.follower.take_velocity(now, self.present(), setpoint, ground)
        self._run()
        self.publish()

    def end_setpoints(self) -> None:
        """Hover at the goal of the last setpoint, if there are setpoints."""
        last = self.follower.setpoint
        if self._stop_timer is None or last is None:
            return
        self.forget()
        try:
            self.begin(CommandFollower.go_to, last.position, last.yaw, _HOLD_DURATION)
        except RefusalError as reason:
            # The last reference has a velocity, which the controller continues.
            self._handle.warn(
                f"setpoints have stopped, and {reason}: the vehicle stays at the last one"
            )
            self.publish(at_rest(last.position, last.yaw))

    def rest(self) -> None:
        """Publish a reference at rest, if the controller follows one that moves."""
        goal = self.follower.goal(self._handle.time())
        if self._stop_timer is not None and goal is not None:
            self.publish(at_rest(goal.position, goal.yaw))

    def forget(self) -> None:
        """End references; uploaded trajectories stay."""
        self.follower.forget()
        self._end()

    def publish(self, goal: Goal[float] | None = None) -> None:
        """Publish a goal as reference, by default the present one."""
        goal = goal or self.follower.goal(self._handle.time())
        if goal is None:
            return
        if self._vehicle is not None:
            self._vehicle.follow(goal)
            return
        message = reference_message(goal, self._parameters.has_yaw)
        message.header.stamp = self._handle.stamp()
        self._publisher.publish(message)

    def _run(self):
        """Show the plan, and start the timer: a fleet has many vehicles, most of them at rest."""
        self._plan.show(self.follower.trajectory)
        if self._stop_timer is not None:
            return
        period = self._parameters.time_step
        if self._vehicle is None:
            self._stop_timer = self._handle.timer(period, self._on_timer).stop
        else:
            self._stop_timer = self._vehicle.timer(period, self._handle.guard(self._on_timer))

    def _end(self):
        self._plan.show(None)
        if self._stop_timer is not None:
            self._stop_timer()
            self._stop_timer = None

    def _on_timer(self):
        now = self._handle.time()
        if self.follower.setpoint and not 0.0 <= now - self.follower.start_time < LEVEL_AGE:
            self.end_setpoints()
        if self.follower.setpoint:
            return
        place = self._present_hold()
        is_move = self.follower.is_move
        if is_move and place is not None and place is not self._held_at:
            # In the middle of the move, its speed would pull the vehicle towards the other one.
            self._held_at = place
            self.follower.restart_move(now, place)
            self.publish()
        elif is_move and (place is not None or self._measured() is None):
            self.follower.delay(self._parameters.time_step)
        else:
            # The last one, at rest, is published, too.
            self.publish()
            if not self.follower.is_moving(now):
                self._end()

    def _on_state(self, message):
        x, y, z, vx, vy, vz, yaw = to_tuple(message.state)
        yaw = yaw if self._parameters.has_yaw else 0.0
        self._state = Goal((x, y, z), (vx, vy, vz), (0.0,) * 3, yaw, 0.0)
        self._state_time = self._handle.time()

    def _present_hold(self):
        """Return the place where the vehicle is held, m; None if it is not."""
        return None if self._vehicle is None else self._vehicle.held_at

    def _measured(self):
        """Return the present state of the vehicle; None if it is not known."""
        if self._vehicle is not None:
            return self._vehicle.goal()
        is_fresh = 0.0 <= self._handle.time() - self._state_time < MAX_POSITION_AGE
        return self._state if is_fresh else None
