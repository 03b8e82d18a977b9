"""Merger for a prioritised controller that decides on everything."""

from crazyflie_control_merger.merger_node import MergerNode
from crazyflie_msgs.msg import PrioritizedControlStamped
from crazyflie_utils.vectors import to_vector


class RegularControlMergerNode(MergerNode):
    """Mix roll, pitch, yaw rate and thrust."""

    prioritized_type = PrioritizedControlStamped

    def split(self, prioritized) -> tuple:
        """See `MergerNode.split`."""
        return to_vector(prioritized.control), prioritized.priority
