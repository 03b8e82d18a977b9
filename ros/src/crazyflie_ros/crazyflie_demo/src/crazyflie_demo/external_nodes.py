"""ROS interface between VRPN or Vicon and a vehicle's estimator."""

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Point, PointStamped, PoseStamped, TransformStamped
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC


class ExternalParameters(Parameters):
    """Parameters of the nodes that pass a measurement on."""

    topic: str = parameter(TOPIC, "where motion capture publishes the vehicle")


class _ExternalNode(Node):
    """Pass a measurement on to ``output``, with stamp and frame; drop it if not finite."""

    input_type: type
    finite: str
    output: str
    output_type: type
    _convert: Callable[[Any], Any]

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(ExternalParameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._publisher = handle.publisher(self.output, self.output_type)
        handle.subscribe(
            self._parameters.topic, self.input_type, self._on_measurement, finite=self.finite
        )

    def _on_measurement(self, message):
        self._publisher.publish(self._convert(message))


class ExternalPoseViconNode(_ExternalNode):
    """Vicon's transform of a vehicle, as an external pose for its estimator."""

    input_type, finite = TransformStamped, "transform"
    output, output_type = "external_pose", PoseStamped

    @staticmethod
    def _convert(message: TransformStamped) -> PoseStamped:
        pose = PoseStamped(header=message.header)
        pose.pose.position = _point(message)
        pose.pose.orientation = message.transform.rotation
        return pose


class ExternalPositionViconNode(_ExternalNode):
    """Vicon's transform of a vehicle, as an external position for its estimator."""

    input_type, finite = TransformStamped, "transform"
    output, output_type = "external_position", PointStamped

    @staticmethod
    def _convert(message: TransformStamped) -> PointStamped:
        return PointStamped(message.header, _point(message))


class ExternalPositionVrpnNode(_ExternalNode):
    """A vehicle's pose from VRPN, as an external position for its estimator."""

    input_type, finite = PoseStamped, "pose"
    output, output_type = "external_position", PointStamped

    @staticmethod
    def _convert(message: PoseStamped) -> PointStamped:
        return PointStamped(message.header, message.pose.position)


def _point(message):
    t = message.transform.translation
    return Point(t.x, t.y, t.z)
