"""ROS interface between VRPN or Vicon and a vehicle's estimator."""

from geometry_msgs.msg import Point, PointStamped, Pose, PoseStamped, TransformStamped
from typing_extensions import override

from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameters.types import TOPIC


class ExternalParameters(Parameters):
    """Parameters of the nodes that pass a measurement on."""

    topic: str = parameter(TOPIC, "where motion capture publishes the vehicle")


class _ExternalNode(Node[ExternalParameters]):
    """Pass a measurement on, with stamp and frame; drop it if not finite."""

    input_type: type = TransformStamped
    output_type: type = PointStamped

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        output = "external_pose" if self.output_type is PoseStamped else "external_position"
        finite = "pose" if self.input_type is PoseStamped else "transform"
        self._publisher = handle.publisher(output, self.output_type)
        topic = self._parameters.topic
        handle.subscribe(topic, self.input_type, self._on_measurement, finite=finite)

    def _on_measurement(self, message):
        if self.input_type is PoseStamped:
            place, attitude = message.pose.position, message.pose.orientation
        else:
            place, attitude = message.transform.translation, message.transform.rotation
        point = Point(place.x, place.y, place.z)
        if self.output_type is PoseStamped:
            self._publisher.publish(PoseStamped(message.header, Pose(point, attitude)))
        else:
            self._publisher.publish(PointStamped(message.header, point))


class ExternalPoseViconNode(_ExternalNode):
    """Vicon's transform of a vehicle, as an external pose for its estimator."""

    output_type = PoseStamped


class ExternalPositionViconNode(_ExternalNode):
    """Vicon's transform of a vehicle, as an external position for its estimator."""


class ExternalPositionVrpnNode(_ExternalNode):
    """A vehicle's pose from VRPN, as an external position for its estimator."""

    input_type = PoseStamped
