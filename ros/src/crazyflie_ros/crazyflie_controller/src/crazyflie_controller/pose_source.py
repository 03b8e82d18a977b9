"""The pose of a vehicle from tf."""

from crazyflie_controller.go_to import HeadingPose
from crazyflie_model.angles import Quaternion, Triple, rpy_from_quaternion
from crazyflie_utils import NodeHandle, Parameters, TransformError, parameter
from crazyflie_utils.parameters.types import FRAME


class WorldFrameParameters(Parameters):
    """The frame of goals and poses."""

    world_frame: str = parameter(FRAME, "frame of goals and poses", "world", "worldFrame")


class PoseParameters(WorldFrameParameters):
    """Parameters of a `PoseSource`."""

    frame: str = parameter(FRAME, "the vehicle's frame")


class PoseSource:
    """The latest pose of a vehicle; logs a warning without a pose."""

    def __init__(self, handle: NodeHandle, parameters: PoseParameters):
        self._handle = handle
        self._parameters = parameters
        self._lookup = handle.listen_to_poses()

    def latest(self) -> tuple[float, HeadingPose] | tuple[None, None]:
        """Return stamp (s of ROS time) and latest pose in the world frame, or None twice."""
        parameters = self._parameters
        try:
            found = self._lookup(parameters.world_frame, parameters.frame)
        except TransformError as error:
            self._handle.warn(
                f"no pose of {parameters.frame} in {parameters.world_frame}: {error}",
                throttle=5.0,
                key="tf",
            )
            return None, None
        return found.stamp * 1e-9, heading_pose(found.position, found.rotation)


def heading_pose(position: Triple, rotation: Quaternion) -> HeadingPose:
    """Return the pose of a position (m) and a rotation."""
    return HeadingPose(*position, rpy_from_quaternion(*rotation)[2])
