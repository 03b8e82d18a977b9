"""ROS interface of a trajectory that is streamed, setpoint by setpoint."""

from concurrent.futures import Future
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, Vector3
from typing_extensions import override

from crazyflie_demo.parameters import RATE
from crazyflie_demo.stream_node import StreamNode
from crazyflie_demo.trajectory_file import TrajectoryError
from crazyflie_demo.uav_trajectory import Trajectory
from crazyflie_driver.msg import FullState
from crazyflie_model.angles import quaternion_from_rpy
from crazyflie_utils import NodeHandle, ParameterError, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC

_REST = np.zeros(3)


class TrajectoryStreamParameters(Parameters):
    """Parameters of `TrajectoryStreamNode`."""

    topic: str = parameter(TOPIC, "where setpoints go", "/crazyflie/cmd_full_state")
    rate: float = parameter(RATE, "setpoints a second", 100.0)


class TrajectoryStreamNode(StreamNode):
    """Stream the trajectory of a CSV file as it is, in the world frame; then land."""

    message_type = FullState

    def __init__(self, file: str):
        super().__init__()
        self._file = file
        self._trajectory = Trajectory()

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        parameters = handle.load(TrajectoryStreamParameters)
        self.topic, self.rate = parameters.topic, parameters.rate
        try:
            self._trajectory.loadcsv(self._file)
        except TrajectoryError as error:
            raise ParameterError(str(error)) from None
        self.duration = self._trajectory.duration

    @override
    def setpoint(self, time: float) -> FullState:
        goal = self._trajectory.eval(time)
        if time >= self.duration:
            # It is repeated until the vehicle lands.
            goal = goal._replace(vel=_REST, acc=_REST, omega=_REST)
        message = FullState(
            pose=Pose(Point(*goal.pos), Quaternion(*quaternion_from_rpy(0.0, 0.0, goal.yaw))),
            twist=Twist(Vector3(*goal.vel), Vector3(*goal.omega)),
            acc=Vector3(*goal.acc),
        )
        message.header.frame_id = "world"
        return message

    @override
    def finish(self) -> Future[Any]:
        # Without it the vehicle would be locked 2 s later, or fall.
        return self.land()
