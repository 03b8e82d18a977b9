"""ROS interface of every controller that turns a state and a reference into a control."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_lqr.gain_file import MatrixFile, VectorFile
from crazyflie_lqr.linear_feedback import LinearFeedback
from crazyflie_lqr.reference import GuardedReference
from crazyflie_msgs.msg import Control, ControlStamped
from crazyflie_utils import Node, NodeHandle, Parameters, parameter
from crazyflie_utils.parameter_types import TOPIC, Integer
from crazyflie_utils.vectors import from_vector, to_vector


class LinearFeedbackParameters(Parameters):
    """Parameters of a controller of 7 states; one of more declares `x_dim` and `K` anew."""

    x_dim: int = parameter(Integer(7, 7), "length of the state")
    u_dim: int = parameter(Integer(4, 4), "length of the control")
    K: NDArray[np.float64] = parameter(
        MatrixFile(4, 7), "gain file, `u_dim` rows of `x_dim` numbers", name="K_file", live=True
    )
    u_ref: NDArray[np.float64] = parameter(
        VectorFile(4),
        "control at the reference, `u_dim` numbers in one row or one column",
        name="u_ref_file",
        live=True,
    )
    reference_topic: str = parameter(TOPIC, "where references come from", name="topics/reference")
    state_topic: str = parameter(TOPIC, "where states come from", name="topics/state")
    control_topic: str = parameter(TOPIC, "where controls go", name="topics/control")


class LinearFeedbackNode(Node):
    """Answer every state with a control that leads towards the reference.

    A subclass describes its state in class attributes, and may override
    `complete_reference` and `make_controller`.

    Attributes
    ----------
    state_type, reference_type : type
        Stamped messages with a field ``state``, all float64.
    parameters_type : type
        `LinearFeedbackParameters` or a subclass.
    yaw_index : int
        Where the yaw is in the state, which begins with position and velocity.
    """

    state_type: type
    reference_type: type
    parameters_type: type[LinearFeedbackParameters] = LinearFeedbackParameters
    yaw_index: int

    def __init__(self) -> None:
        self._reference = GuardedReference(self.yaw_index)

    def complete_reference(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reference state, shape (x_dim,), that a reference message means.

        Parameters
        ----------
        reference : ndarray, shape (number of fields,)
            The fields of the message.
        """
        return reference

    def make_controller(self, parameters: Any) -> LinearFeedback:
        """Return the control law, at the start and after a change of live parameters.

        Parameters
        ----------
        parameters : LinearFeedbackParameters
            Of the type `parameters_type`.
        """
        return LinearFeedback(parameters.K, parameters.u_ref, self.yaw_index)

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        self._parameters = handle.load(self.parameters_type, self._reconfigure)
        self._controller = self.make_controller(self._parameters)

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.control_topic, ControlStamped)
        handle.subscribe(
            parameters.reference_topic,
            self.reference_type,
            self._on_reference,
            finite="state",
            on_invalid=self._on_invalid_reference,
        )
        handle.subscribe(parameters.state_topic, self.state_type, self._on_state, finite="state")

    def _reconfigure(self, parameters):
        controller = self.make_controller(parameters)
        controller.take_over(self._controller)
        self._controller = controller

    def _on_reference(self, message):
        self._reference.update(self.complete_reference(to_vector(message.state)))

    def _on_invalid_reference(self):
        self._reference.invalidate(self._handle.time())

    def _on_state(self, message):
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
