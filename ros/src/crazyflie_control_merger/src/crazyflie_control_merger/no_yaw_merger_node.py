"""Merger for a prioritised controller that leaves the yaw alone."""

from numpy.typing import ArrayLike
from typing_extensions import override

from crazyflie_control_merger.merger_node import MergerNode
from crazyflie_control_merger.merging import NO_YAW_ENTRIES
from crazyflie_msgs.msg import NoYawControl, NoYawControlStamped
from crazyflie_utils.vectors import to_vector


class NoYawMergerNode(MergerNode):
    """Mix roll, pitch and thrust; the yaw rate is always the regular one."""

    prioritized_type = NoYawControlStamped
    entries = NO_YAW_ENTRIES

    @override
    def split(self, prioritized: NoYawControl) -> tuple[ArrayLike, float]:
        *control, priority = to_vector(prioritized)
        return control, priority
