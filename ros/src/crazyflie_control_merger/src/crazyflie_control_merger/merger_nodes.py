"""ROS interfaces of the mergers of two controls."""

import math

import genpy
from numpy.typing import ArrayLike
from typing_extensions import override

from crazyflie_control_merger.merging import ALL_ENTRIES, MODES, NO_YAW_ENTRIES, Merger
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    NoYawControl,
    NoYawControlStamped,
    PrioritizedControl,
    PrioritizedControlStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import Text
from crazyflie_utils.vectors import from_vector, to_vector

REGULAR_AGE = 0.1  #: Age of a regular control beyond which a prioritised one is not mixed in (s).


class MergerParameters(Parameters):
    """Parameters of both mergers."""

    control_topic: str = topic("control", "where regular controls come from")
    prioritized_topic: str = topic("prioritized_control", "where prioritised controls come from")
    merged_topic: str = topic("merged", "where merged controls go")
    mode: str = parameter(
        Text(choices=MODES), "p is the priority that came with the control; 0; 1", live=True
    )


class MergerNode(Node[MergerParameters]):
    """Publish each regular control with the prioritised one mixed in, and each prioritised one.

    A subclass names its prioritised control in class attributes and implements `split`.
    """

    needed_in_flight = True

    prioritized_type: type[genpy.Message]  #: Stamped message with a field ``control``.
    entries: tuple[int, ...] = ALL_ENTRIES  #: Entries of the control that it decides on.

    def split(self, prioritized: genpy.Message) -> tuple[ArrayLike, float]:
        """Return the control, shape (len(entries),), and priority of a message's ``control``."""
        raise NotImplementedError

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._merger = Merger(self.entries)
        self._regular: ControlStamped | None = None
        self._regular_time = -math.inf
        self._publisher = handle.publisher(parameters.merged_topic, ControlStamped)
        handle.subscribe(
            parameters.prioritized_topic,
            self.prioritized_type,
            self._on_prioritized,
            finite="control",
        )
        handle.subscribe(
            parameters.control_topic, ControlStamped, self._on_control, finite="control"
        )

    def _on_prioritized(self, message):
        control, priority = self.split(message.control)
        if not 0.0 <= priority <= 1.0:
            self._handle.warn(
                f"the priority on {self._parameters.prioritized_topic} is {priority:g}; "
                "expected 0 ... 1",
                throttle=1.0,
                key="priority",
            )
        now = self._handle.time()
        self._merger.prioritize(control, priority, now)
        # After the end of the regular controls, the vehicle's next node must see that they end.
        is_fresh = 0.0 <= now - self._regular_time < REGULAR_AGE
        if is_fresh and self._merger.weight(now, self._parameters.mode) > 0.0:
            self._publish(self._regular, message.header.stamp)

    def _on_control(self, message):
        self._regular, self._regular_time = message, self._handle.time()
        self._publish(message, message.header.stamp)

    def _publish(self, regular, stamp):
        now, mode = self._handle.time(), self._parameters.mode
        u = self._merger.merged(to_vector(regular.control), now, mode)
        merged = ControlStamped(control=from_vector(Control, u))
        merged.header.stamp = max(stamp, regular.header.stamp)
        self._publisher.publish(merged)


class NoYawMergerNode(MergerNode):
    """Mix roll, pitch and thrust; the yaw rate is always the regular one."""

    prioritized_type = NoYawControlStamped
    entries = NO_YAW_ENTRIES

    @override
    def split(self, prioritized: NoYawControl) -> tuple[ArrayLike, float]:
        *control, priority = to_vector(prioritized)
        return control, priority


class RegularControlMergerNode(MergerNode):
    """Mix roll, pitch, yaw rate and thrust."""

    prioritized_type = PrioritizedControlStamped

    @override
    def split(self, prioritized: PrioritizedControl) -> tuple[ArrayLike, float]:
        return to_vector(prioritized.control), prioritized.priority
