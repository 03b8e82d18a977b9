"""Merger for a prioritised controller that decides on everything."""

from numpy.typing import ArrayLike
from typing_extensions import override

from crazyflie_control_merger.merger_node import MergerNode
from crazyflie_msgs.msg import PrioritizedControl, PrioritizedControlStamped
from crazyflie_utils.vectors import to_vector


class RegularControlMergerNode(MergerNode):
    """Mix roll, pitch, yaw rate and thrust."""

    prioritized_type = PrioritizedControlStamped

    @override
    def split(self, prioritized: PrioritizedControl) -> tuple[ArrayLike, float]:
        return to_vector(prioritized.control), prioritized.priority
