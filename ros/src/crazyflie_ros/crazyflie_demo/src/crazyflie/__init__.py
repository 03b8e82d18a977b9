"""The driver's services as methods of a class: the module that users' scripts import by this name.

Such a script is a node of its own and calls rospy.init_node first: this is plain rospy, and its
methods block.
"""

# The names of methods and arguments are those that existing scripts use.
# ruff: noqa: N802, N803

import atexit
import contextlib
import math
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from numpy.typing import NDArray
from std_msgs.msg import Empty, Float32
from std_srvs.srv import Empty as EmptyService
from uav_trajectory import Trajectory

from crazyflie_driver import srv
from crazyflie_driver.msg import FullState, Position, TrajectoryPolynomialPiece, VelocityWorld
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_utils.tf.transforms import MAX_FUTURE_STAMP_SIMULATED

_WORLD = "world"  #: The fixed frame, unless the script's parameter ~frames/fixed says otherwise.
_TF_LIMIT = 10.0  #: Timeout of a position or a voltage (s).
#: Age limit of a position (s): tf keeps the last one of a vehicle that is not tracked any more.
_MAX_POSITION_AGE = 0.5

_LANDING = 5.0  #: Duration of the landing at the end of a script (s).

#: Namespace, below a vehicle's name, of crazyflie_mission_api's high_level_node, which offers the
#: driver's services for a vehicle that a controller of this workspace flies.
_COMMANDER = "high_level"

_SETPOINTS = {
    "cmd_full_state": FullState,
    "cmd_position": Position,
    "cmd_velocity_world": VelocityWorld,
    "cmd_stop": Empty,
}

_SERVICES = {
    "emergency": EmptyService,
    "notify_setpoints_stop": srv.NotifySetpointsStop,
    "update_params": srv.UpdateParams,
    "set_group_mask": srv.SetGroupMask,
    "takeoff": srv.Takeoff,
    "land": srv.Land,
    "stop": srv.Stop,
    "go_to": srv.GoTo,
    "upload_trajectory": srv.UploadTrajectory,
    "start_trajectory": srv.StartTrajectory,
}


class Crazyflie:
    """A vehicle of the driver, or a simulated one; the constructor blocks until it is available.

    However the script ends, a vehicle that it has made fly, and not landed since, is landed.

    A command returns when the vehicle has received it, not when it has been carried out. Every
    method raises `rospy.ServiceException` when the driver refuses. ``prefix`` is the vehicle's
    namespace, its tf_prefix; ``tf`` is for `position` only: the vehicle's tf frame, or a
    tf.TransformListener or tf2_ros.Buffer, which is asked for the frame ``prefix``.
    """

    _world = _WORLD

    def __init__(self, prefix: str, tf: Any):
        self.prefix = prefix.rstrip("/")
        self.tf = tf
        self._world = rospy.get_param("~frames/fixed", _WORLD)
        self._buffer: tf2_ros.Buffer | None = None
        self._services = {}
        top = _commander(self.prefix)
        for name, service_type in _SERVICES.items():
            rospy.wait_for_service(f"{top}/{name}")
            self._services[name] = rospy.ServiceProxy(f"{top}/{name}", service_type)
        self._setpoints = {
            name: rospy.Publisher(f"{top}/{name}", message_type, queue_size=1)
            for name, message_type in _SETPOINTS.items()
        }
        # Answered when the driver has read the parameters; values that are set earlier are
        # overwritten.
        self._call("update_params", [])
        self._may_fly = False  # Whether the script has made it fly.
        self._has_ended = False
        # Reentrant: a signal may end the script within a command, in the same thread.
        self._commands = threading.RLock()
        # Services still answer then, also after `rospy.spin()`.
        rospy.on_shutdown(self._land_at_end)
        atexit.register(self._land_at_end)

    def _call(self, service, *arguments):
        self._services[service](*arguments)

    @contextlib.contextmanager
    def _commanding(self):
        # Another thread may go on after the landing has begun.
        with self._commands:
            if self._has_ended:
                raise rospy.ROSInterruptException(f"{self.prefix} lands, since the script ends")
            # Also a command that is refused may have been obeyed.
            self._may_fly = True
            yield

    def _fly(self, service, *arguments):
        with self._commanding():
            self._call(service, *arguments)

    def _come_down(self, service, *arguments):
        self._call(service, *arguments)
        self._may_fly = False

    def _land_at_end(self):
        self._has_ended = True
        # A command that is being sent is sent before the landing. Who comes second waits for it:
        # the process would end within.
        with self._commands:
            if not self._may_fly:
                return
            rospy.logwarn("landing %s, since the script ends", self.prefix)
            try:
                self.land(0.0, _LANDING)
            except rospy.ServiceException as error:
                rospy.logerr("MAY STILL FLY: %s: %s", self.prefix, error)
            self._may_fly = False

    def setGroupMask(self, groupMask: int) -> None:
        """Make the vehicle a member of groups, one for each bit."""
        self._call("set_group_mask", groupMask)

    def takeoff(self, targetHeight: float, duration: float, groupMask: int = 0) -> None:
        """Climb to a height (m) within a duration (s)."""
        self._fly("takeoff", groupMask, targetHeight, rospy.Duration.from_sec(duration))

    def land(self, targetHeight: float, duration: float, groupMask: int = 0) -> None:
        """Sink to a height (m) within a duration (s)."""
        self._come_down("land", groupMask, targetHeight, rospy.Duration.from_sec(duration))

    def stop(self, groupMask: int = 0) -> None:
        """Stop the motors."""
        self._come_down("stop", groupMask)

    def emergency(self) -> None:
        """Stop the motors at once, for good."""
        self._come_down("emergency")

    def notifySetpointsStop(self, remainValidMillisecs: int = 100, groupMask: int = 0) -> None:
        """Return from setpoints to commands; the last setpoint remains valid for some ms."""
        self._call("notify_setpoints_stop", groupMask, remainValidMillisecs)

    def goTo(
        self,
        goal: Sequence[float],
        yaw: float,
        duration: float,
        relative: bool = False,
        groupMask: int = 0,
    ) -> None:
        """Fly to a point x, y, z (m) and a yaw (rad) within a duration (s)."""
        period = rospy.Duration.from_sec(duration)
        self._fly("go_to", groupMask, relative, Point(*goal), yaw, period)

    def uploadTrajectory(self, trajectoryId: int, pieceOffset: int, trajectory: Trajectory) -> None:
        """Write a trajectory into the vehicle's memory, after ``pieceOffset`` pieces."""
        pieces = [
            TrajectoryPolynomialPiece(
                *(axis.p.tolist() for axis in (piece.px, piece.py, piece.pz, piece.pyaw)),
                rospy.Duration.from_sec(piece.duration),
            )
            for piece in trajectory.polynomials
        ]
        self._call("upload_trajectory", trajectoryId, pieceOffset, pieces)

    def startTrajectory(
        self,
        trajectoryId: int,
        timescale: float = 1.0,
        reverse: bool = False,
        relative: bool = True,
        groupMask: int = 0,
    ) -> None:
        """Fly along a trajectory; with ``timescale`` 2 it takes twice as long."""
        self._fly("start_trajectory", groupMask, trajectoryId, timescale, reverse, relative)

    def position(self) -> NDArray[np.float64]:
        """Return the vehicle's position by tf, shape (3,), m in the fixed frame.

        Raises `tf2_ros.TransformException` or `tf.Exception` if no position has come for 10 s.
        """
        deadline = time.monotonic() + _TF_LIMIT
        while True:
            stamp, position = self._latest_position()
            age = (rospy.Time.now() - stamp).to_sec()
            # A pose without a stamp is static; one far ahead of now is from before the clock was
            # set back.
            if stamp.is_zero() or -MAX_FUTURE_STAMP_SIMULATED <= age < _MAX_POSITION_AGE:
                return np.array(position)
            if time.monotonic() > deadline:
                raise tf2_ros.TransformException(
                    f"{self._frame()} in {self._world}: the last position is {age:.1f} s old; "
                    f"expected at most {_MAX_POSITION_AGE:g} s"
                )
            time.sleep(0.01)

    def _latest_position(self):
        latest, limit = rospy.Time(), rospy.Duration(_TF_LIMIT)
        if hasattr(self.tf, "lookupTransform"):
            frames = (self._world, self.prefix)
            self.tf.waitForTransform(*frames, latest, limit)
            stamp = self.tf.getLatestCommonTime(*frames)
            return stamp, self.tf.lookupTransform(*frames, latest)[0]
        if isinstance(self.tf, str) and self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
        buffer: Any = self._buffer if isinstance(self.tf, str) else self.tf
        found = buffer.lookup_transform(self._world, self._frame().strip("/"), latest, limit)
        p = found.transform.translation
        return found.header.stamp, (p.x, p.y, p.z)

    def _frame(self):
        return self.tf if isinstance(self.tf, str) else self.prefix

    def getVoltage(self) -> float:
        """Return the battery's voltage, V; `rospy.ROSException` if none comes for 10 s."""
        return rospy.wait_for_message(f"{self.prefix}/battery", Float32, _TF_LIMIT).data

    # Setpoints: the firmware levels out 0.5 s after the last one.

    def cmdFullState(
        self,
        pos: Sequence[float],
        vel: Sequence[float],
        acc: Sequence[float],
        yaw: float,
        omega: Sequence[float],
    ) -> None:
        """Track a position, m, with velocity and acceleration, yaw (rad) and body rates (rad/s)."""
        message = FullState(
            pose=Pose(Point(*pos), Quaternion(*quaternion_from_rpy(0.0, 0.0, yaw))),
            twist=Twist(Vector3(*vel), Vector3(*omega)),
            acc=Vector3(*acc),
        )
        self._send("cmd_full_state", message)

    def cmdPosition(self, pos: Sequence[float], yaw: float = 0.0) -> None:
        """Track a position, m, and a yaw, rad."""
        self._send("cmd_position", Position(None, *pos, math.degrees(yaw)))

    def cmdVelocityWorld(self, vel: Sequence[float], yawRate: float) -> None:
        """Fly at a velocity, m/s, and turn at a rate, degrees/s, with the driver's sign."""
        self._send("cmd_velocity_world", VelocityWorld(None, Vector3(*vel), yawRate))

    def cmdStop(self) -> None:
        """Stop the motors, as a setpoint."""
        self._setpoints["cmd_stop"].publish(Empty())
        self._may_fly = False

    def _send(self, name, message):
        message.header.stamp = rospy.Time.now()
        message.header.frame_id = self._world
        with self._commanding():
            self._setpoints[name].publish(message)

    def getParam(self, name: str) -> Any:
        """Return a firmware parameter GROUP/NAME."""
        return rospy.get_param(f"{self.prefix}/{name}")

    def setParam(self, name: str, value: float) -> None:
        """Set a firmware parameter GROUP/NAME."""
        self.setParams({name: value})

    def setParams(self, params: Mapping[str, float]) -> None:
        """Set firmware parameters, GROUP/NAME -> value."""
        for name, value in params.items():
            rospy.set_param(f"{self.prefix}/{name}", value)
        self._call("update_params", list(params))


def _commander(prefix):
    """Return the namespace of a vehicle's services; blocks until the services exist."""
    tops = (f"{prefix}/{_COMMANDER}", prefix)
    rospy.loginfo("waiting for update_params below %s or %s", *map(rospy.resolve_name, tops))
    while True:
        for top in tops:
            # The service does not exist yet; the wait is logged above.
            with contextlib.suppress(rospy.ROSException):
                rospy.wait_for_service(f"{top}/update_params", 0.2)
                return top
            if rospy.is_shutdown():
                raise rospy.ROSInterruptException("ROS has shut down")
