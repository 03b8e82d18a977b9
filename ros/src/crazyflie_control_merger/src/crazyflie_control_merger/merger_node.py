"""ROS interface of every merger of two controls."""

from crazyflie_control_merger.merging import ALL_ENTRIES, MODES, Merger
from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC, Text
from crazyflie_utils.vectors import from_vector, is_finite, to_vector


class MergerNode(Node):
    """Publish each regular control with the prioritised one mixed in.

    A subclass says in class attributes what kind of prioritised control it
    takes, and implements `split`.

    Attributes
    ----------
    prioritized_type : type
        Stamped message with a field ``control``.
    entries : tuple of int
        Entries of the control that it decides on.
    """

    prioritized_type: type
    entries = ALL_ENTRIES

    def __init__(self):
        super().__init__()
        self._control_topic = None
        self._prioritized_topic = None
        self._merged_topic = None
        self._merger = None
        self._publisher = None

    def split(self, prioritized) -> tuple:
        """Return the control, ndarray of shape (len(entries),), and the priority of a message.

        Parameters
        ----------
        prioritized : genpy.Message
            The field ``control`` of a prioritised message.
        """
        raise NotImplementedError

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        self._control_topic = handle.param("topics/control", TOPIC)
        self._prioritized_topic = handle.param("topics/prioritized_control", TOPIC)
        self._merged_topic = handle.param("topics/merged", TOPIC)
        self._merger = Merger(handle.param("mode", Text(choices=MODES)), self.entries)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._merged_topic, ControlStamped)
        handle.subscribe(self._prioritized_topic, self.prioritized_type, self._on_prioritized)
        handle.subscribe(self._control_topic, ControlStamped, self._on_control)

    def _on_prioritized(self, message):
        if not is_finite(message.control):
            self._warn_not_finite(self._prioritized_topic)
            return
        control, priority = self.split(message.control)
        if not 0.0 <= priority <= 1.0:
            self._handle.warn(
                f"the priority on {self._prioritized_topic} is {priority:g}; expected 0 ... 1",
                throttle=1.0,
                key="priority",
            )
        self._merger.prioritize(control, priority, self._handle.time())

    def _on_control(self, message):
        if not is_finite(message.control):
            self._warn_not_finite(self._control_topic)
            return
        u = self._merger.merged(to_vector(message.control), self._handle.time())
        merged = ControlStamped(control=from_vector(Control, u))
        merged.header.stamp = message.header.stamp
        self._publisher.publish(merged)

    def _warn_not_finite(self, topic):
        self._handle.warn(f"ignoring a control on {topic} that is not finite", throttle=1.0)
