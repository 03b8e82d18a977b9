"""Merger for a prioritised controller that leaves the yaw alone."""

from crazyflie_control_merger.merger_node import MergerNode
from crazyflie_control_merger.merging import NO_YAW_ENTRIES
from crazyflie_msgs.msg import NoYawControlStamped
from crazyflie_utils.vectors import to_vector


class NoYawMergerNode(MergerNode):
    """Mix roll, pitch and thrust; the yaw rate is always the regular one."""

    prioritized_type = NoYawControlStamped
    entries = NO_YAW_ENTRIES

    def split(self, prioritized) -> tuple:
        """See `MergerNode.split`."""
        *control, priority = to_vector(prioritized)
        return control, priority
