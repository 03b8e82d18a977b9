"""ROS interface of every controller that turns a state and a reference into a control."""

import numpy as np

from crazyflie_lqr.gain_file import MatrixFile, VectorFile
from crazyflie_lqr.linear_feedback import LinearFeedback
from crazyflie_lqr.reference import GuardedReference
from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils.node import Node
from crazyflie_utils.parameter_types import TOPIC, Integer
from crazyflie_utils.vectors import from_vector, is_finite, to_vector


class LinearFeedbackNode(Node):
    """Answer every state with a control that leads towards the reference.

    A subclass says in class attributes what it works with, and may override
    `lift` and `make_controller`.

    Attributes
    ----------
    state_type, reference_type : type
        Stamped messages with a field ``state``, all float64.
    x_dim, u_dim : int
        Lengths of state and control.
    yaw_index : int
        Where the yaw is in the state, which begins with position and velocity.
    """

    state_type: type
    reference_type: type
    x_dim: int
    u_dim = 4
    yaw_index: int

    def __init__(self):
        super().__init__()
        self._state_topic = None
        self._reference_topic = None
        self._control_topic = None
        self._controller = None
        self._reference = GuardedReference(self.yaw_index)
        self._publisher = None

    def lift(self, reference: np.ndarray) -> np.ndarray:
        """Return the reference state, shape (x_dim,), that a reference message means.

        Parameters
        ----------
        reference : ndarray, shape (number of fields,)
            The fields of the message.
        """
        return reference

    def make_controller(self, handle, K: np.ndarray, u_ref: np.ndarray):
        """Return the control law: an object with the ``control`` of `LinearFeedback`.

        Parameters
        ----------
        handle : NodeHandle
            For parameters of one's own.
        K : ndarray, shape (u_dim, x_dim)
        u_ref : ndarray, shape (u_dim,)
        """
        return LinearFeedback(K, u_ref, self.yaw_index)

    def load_parameters(self, handle) -> None:
        """See `Node.load_parameters`."""
        x_dim = handle.param("x_dim", Integer(self.x_dim, self.x_dim))
        u_dim = handle.param("u_dim", Integer(self.u_dim, self.u_dim))
        K = handle.param("K_file", MatrixFile(u_dim, x_dim))
        u_ref = handle.param("u_ref_file", VectorFile(u_dim))
        self._reference_topic = handle.param("topics/reference", TOPIC)
        self._state_topic = handle.param("topics/state", TOPIC)
        self._control_topic = handle.param("topics/control", TOPIC)
        self._controller = self.make_controller(handle, K, u_ref)

    def register_callbacks(self, handle) -> None:
        """See `Node.register_callbacks`."""
        self._publisher = handle.publisher(self._control_topic, ControlStamped)
        handle.subscribe(self._reference_topic, self.reference_type, self._on_reference)
        handle.subscribe(self._state_topic, self.state_type, self._on_state)

    def _on_reference(self, message):
        if is_finite(message.state):
            self._reference.good(self.lift(to_vector(message.state)))
            return
        self._reference.bad(self._handle.time())
        self._handle.warn(
            f"ignoring a reference on {self._reference_topic} that is not finite", throttle=1.0
        )

    def _on_state(self, message):
        if not is_finite(message.state):
            self._handle.warn(
                f"ignoring a state on {self._state_topic} that is not finite", throttle=1.0
            )
            return
        x = to_vector(message.state)
        x_ref = self._reference.value(self._handle.time(), x)
        if x_ref is None:
            return
        u = self._controller.control(x, x_ref, message.header.stamp.to_sec())
        if not np.isfinite(u).all():
            self._handle.warn(f"the control {u} is not finite and is not sent", throttle=1.0)
            return
        control = ControlStamped(control=from_vector(Control, u))
        control.header.stamp = message.header.stamp
        self._publisher.publish(control)
