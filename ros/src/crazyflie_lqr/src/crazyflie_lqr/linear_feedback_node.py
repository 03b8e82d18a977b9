"""ROS interface of every controller that turns a state and a reference into a control."""

import math
from collections.abc import Iterator
from itertools import chain
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from std_msgs.msg import Float64
from typing_extensions import override

from crazyflie_lqr.flown_control import FlownControl
from crazyflie_lqr.gain_file import CONTROL_FILE, MatrixFile
from crazyflie_lqr.linear_feedback import (
    U_DIM,
    GroundGuess,
    IntegralStateFeedback,
    LinearFeedback,
)
from crazyflie_lqr.state_age import StateAge
from crazyflie_model.limits import HOLD_LIMIT, MAX_THRUST, MIN_THRUST
from crazyflie_msgs.msg import Control, ControlStamped, FlightStatus
from crazyflie_references.governed_references import ReferenceParameters
from crazyflie_utils import Node, NodeHandle, ParameterError, parameter, topic
from crazyflie_utils.flight_status import FlightTopics
from crazyflie_utils.parameters import vehicle_model
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import TEXT, Converted, Integer, Number
from crazyflie_utils.vectors import from_vector, stamped, to_tuple

MAX_GAIN = 1e6  #: Largest entry of a gain file: larger ones give controls that are not finite.


def _gains(value):
    path = TEXT(value)
    if not vehicle_model.is_model(path):
        return _GAIN_FILE(path)
    # Imported here, since python-control takes a second to load, and most controllers read a file.
    from crazyflie_lqr.vehicle_gains import gains

    try:
        return gains(vehicle_model.load(path))
    except ParameterError as error:
        raise ValueError(str(error)) from None


_GAIN_FILE = MatrixFile(4, 7)
#: The path of a gain file; or a type of vehicle or a model file, for `vehicle_gains`.
GAINS = Converted(_gains, f"{_GAIN_FILE}, or a model of a vehicle", _GAIN_FILE.label)


class LinearFeedbackParameters(ReferenceParameters):
    """Parameters of a controller of 7 states; subclasses declare other `x_dim` and `K`."""

    x_dim: int = parameter(Integer(7, 7), "length of the state")
    u_dim: int = parameter(Integer(4, 4), "length of the control")
    K: NDArray[np.float64] = parameter(
        GAINS,
        "gain file, `u_dim` rows of `x_dim` numbers; or a type of vehicle or a model file, for "
        "which gains are designed",
        name="K_file",
        live=True,
    )
    u_ref: NDArray[np.float64] = parameter(
        CONTROL_FILE,
        "control at the reference, `u_dim` numbers in one row or one column",
        name="u_ref_file",
        live=True,
    )
    state_topic: str = topic("state", "where states come from")
    control_topic: str = topic("control", "where controls go")
    flight: FlightTopics = group(FlightTopics, "topics")
    own_final_control_topic: str | None = topic(
        "final_control",
        "controls that are flown; while others than those of this node are, the integrator rests. "
        "By default the name of control with `final` for `lqr`",
        None,
    )
    own_hover_thrust_topic: str | None = topic(
        "hover_thrust",
        "thrust of hover that the takeoff server has measured; by default the name of in_flight + "
        "`_hover_thrust`",
        None,
    )
    max_age: float = parameter(
        Number("s", above=0.0),
        "older states are not answered; if stamps come from another clock, more than a minute "
        "off, their age is the delay",
        HOLD_LIMIT,
        name="state/max_age",
    )

    @override
    def complaints(self) -> Iterator[str]:
        for name, numbers in (("K_file", chain(*self.K)), ("u_ref_file", self.u_ref)):
            largest = max(map(abs, numbers))
            if largest > MAX_GAIN:
                yield f"{name} has {largest:g} among its numbers; expected at most {MAX_GAIN:g}"

    @property
    def final_control_topic(self) -> str | None:
        """Controls that are flown; None if their topic is not known."""
        above, slash, name = self.control_topic.rpartition("/")
        derived = above + slash + name.replace("lqr", "final") if "lqr" in name else None
        return self.own_final_control_topic or derived


class Controller(Protocol):
    """A control law."""

    def control(self, x: NDArray[np.float64], x_ref: NDArray[np.float64], time: float) -> ArrayLike:
        """Return the control, shape (u_dim,), for a state and a reference, both of shape (x_dim,).

        ``time`` is the state's stamp, s.
        """


class LinearFeedbackNode(Node[LinearFeedbackParameters]):
    """Answer every state with a control that moves the vehicle towards the reference.

    A subclass describes its state in class attributes, and may override `complete_reference` and
    `make_controller`.
    """

    needed_in_flight = True

    #: state_type, reference_type: Stamped messages with a field ``state``, all float64.
    state_type: type
    reference_type: type
    yaw_index: int  #: Index of the yaw in the state, which begins with position and velocity.
    #: Reference of the states that the messages do not contain.
    reference_tail: tuple[float, ...] = ()

    def __init__(self) -> None:
        self._flight_state: int = FlightStatus.UNKNOWN
        self._is_flown = False
        self._clocks_agree = False
        self._ground_guess = GroundGuess()
        self._age = StateAge()
        self._flown = FlownControl()
        self._follows_flown = False

    def complete_reference(self, reference: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the reference state, shape (x_dim,), of the fields of a reference message."""
        return np.array([*reference.tolist(), *self.reference_tail])

    def make_controller(self, parameters: Any) -> Controller:
        """Return the control law for parameters of the type `parameters_type`."""
        return LinearFeedback(parameters.K, parameters.u_ref, self.yaw_index)

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        super().load_parameters(handle)
        self._apply(self.make_controller(self._parameters))

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._publisher = handle.publisher(parameters.control_topic, ControlStamped)
        self._references = parameters.follow(
            handle, self.reference_type, self.yaw_index, self._completed, self._on_reference
        )
        parameters.flight.subscribe(handle, self._on_flight_status)
        hover_thrust = parameters.own_hover_thrust_topic or parameters.flight.derived(
            handle, "_hover_thrust"
        )
        handle.subscribe(hover_thrust, Float64, self._on_hover_thrust)
        self._follow_flown()
        handle.subscribe(parameters.state_topic, self.state_type, self._on_state, finite="state")

    def _reconfigure(self, parameters):
        before = self._feedback
        self._apply(self.make_controller(parameters))
        self._feedback.take_over(before)
        self._references.change(parameters.limits)
        self._follow_flown()

    def _follow_flown(self):
        """Subscribe to the controls that are flown, once there is an integrator."""
        feedback, topic = self._feedback, self._parameters.final_control_topic
        has_integral = isinstance(feedback, IntegralStateFeedback) and feedback.has_integral
        if has_integral and topic is not None and not self._follows_flown:
            self._follows_flown = True
            self._handle.subscribe(topic, ControlStamped, self._on_flown, finite="control")

    def _apply(self, controller):
        self._controller = controller
        # Of any other controller, nothing but the control is asked.
        is_feedback = isinstance(controller, LinearFeedback)
        self._feedback = controller if is_feedback else LinearFeedback((), (0.0,) * U_DIM, 0)

    def _on_reference(self):
        if self._flight_state == FlightStatus.TAKING_OFF:
            self._take_off()

    def _completed(self, reference):
        return np.asarray(self.complete_reference(np.array(reference)), dtype=float).tolist()

    def _on_flight_status(self, status):
        if status.state in (self._flight_state, FlightStatus.UNKNOWN):
            return
        self._flight_state = status.state
        if status.state in (FlightStatus.FLYING, FlightStatus.DESCENDING):
            # A controller that did not see the takeoff has not learned the weight.
            self._take_off()
        else:
            self._is_flown = False
            self._feedback.reset_integrator()
            if status.state == FlightStatus.ON_GROUND:
                # The battery, or the load, may be changed.
                self._feedback.hover_thrust = None

    def _on_hover_thrust(self, message):
        if MIN_THRUST <= message.data <= MAX_THRUST:
            self._feedback.hover_thrust = message.data

    def _on_flown(self, message):
        self._flown.receive(to_tuple(message.control), self._handle.time())

    def _take_off(self):
        if not self._is_flown:
            self._is_flown = True
            self._flown.forget()
            self._feedback.take_off()

    def _on_state(self, message):
        now, time = self._handle.time(), message.header.stamp.to_sec()
        if self._is_old(time, now):
            return
        x = to_tuple(message.state)
        x_ref = self._references.value(x)
        if x_ref is None and self._flight_state == FlightStatus.FLYING:
            # The node was restarted in flight; the reference may have been published once, long
            # ago.
            self._references.stay(x)
            x_ref = self._references.value(x)
        if x_ref is None:
            return
        if self._flight_state == FlightStatus.UNKNOWN:
            if self._ground_guess.is_flying(x[2], x_ref[2], now):
                self._feedback.enable_integrator()
            else:
                self._feedback.reset_integrator()
        if self._follows_flown:
            self._feedback.foreign = self._flown.foreign(now)
        control = self._controller.control(np.array(x), np.array(x_ref), time)
        u = np.asarray(control, dtype=float).tolist()
        if not math.isfinite(sum(u)):
            self._handle.warn(
                f"the control {u} is not finite and is not sent", throttle=1.0, key="not finite"
            )
            return
        if self._follows_flown:
            self._flown.send(u, now)
        answer = from_vector(Control, u)
        self._publisher.publish(stamped(ControlStamped, message.header.stamp, control=answer))

    def _is_old(self, stamp, now):
        age = self._age.update(stamp, self._handle.nanoseconds(now) * 1e-9, now)
        if age <= self._parameters.max_age:
            self._clocks_agree = True
            return False
        # If the clocks agreed before, the message was late.
        cause = (
            "this computer, or the network, is too busy, or poses have old stamps"
            if self._clocks_agree
            else "do the machines' clocks agree?"
        )
        self._handle.warn(
            f"ignoring a state that is {age:.1f} s old, expected at most "
            f"{self._parameters.max_age:g} s; {cause}",
            throttle=10.0,
            key="old state",
        )
        return True
