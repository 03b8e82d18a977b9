"""Adds the excitation to the controls of a flight, for a bag from which a model is identified."""

import math

from typing_extensions import override

from crazyflie_identification import excitation
from crazyflie_model.limits import MAX_TILT
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.vectors import stamped

SETTLED = 3.0  #: Time in flight after which the excitation begins, s.
PERIOD = 0.05  #: Period of the references (s).
MAX_DISTANCE = 0.9  #: Distance from the middle at which the excitation is ended, m.
MAX_SPEED = 1.2  #: Speed at which the excitation is ended (m/s).


class ExcitationParameters(Parameters):
    """Parameters of `ExcitationNode`."""

    control_topic: str = topic("control", "controls of the controller")
    excited_topic: str = topic(
        "excited", "where controls with the excitation go: to the takeoff filter"
    )
    reference_topic: str = topic("reference", "where references go")
    state_topic: str = topic("state", "where states come from")
    flight_status_topic: str = topic("flight_status", "flight status of the takeoff server")
    duration: float = parameter(
        Number("s", minimum=5.0, maximum=120.0), "length of the excitation", 45.0
    )


class ExcitationNode(Node[ExcitationParameters]):
    """Passes controls on, and adds small sines while a vehicle hovers after its takeoff.

    The sines begin 3 s after the takeoff, once in a flight, and end after the duration. They end at
    once if the vehicle is further from the middle, or faster, than they can move it. The takeoff
    filter limits the sum as it limits every control.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._flying_since: float | None = None
        self._begun: float | None = None
        self._is_over = False
        self._middle = (0.0, 0.0, 0.0)
        self._position: tuple[float, float, float] | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        own = self._parameters
        self._excited = handle.publisher(own.excited_topic, ControlStamped)
        self._references = handle.publisher(own.reference_topic, PositionVelocityStateStamped)
        handle.subscribe(own.control_topic, ControlStamped, self._on_control, finite="control")
        handle.subscribe(
            own.state_topic, PositionVelocityYawStateStamped, self._on_state, finite="state"
        )
        handle.subscribe(own.flight_status_topic, FlightStatus, self._on_flight_status)
        handle.timer(PERIOD, self._on_timer)

    def _on_flight_status(self, message):
        if message.state != FlightStatus.FLYING:
            self._flying_since = self._begun = None
            self._is_over = False
        elif self._flying_since is None:
            self._flying_since = self._handle.time()

    def _on_state(self, message):
        s = message.state
        self._position = (s.x, s.y, s.z)
        if self._begun is None:
            return
        distance = math.dist(self._position, self._middle)
        speed = math.hypot(s.x_dot, s.y_dot, s.z_dot)
        if distance > MAX_DISTANCE or speed > MAX_SPEED:
            self._end(
                f"the vehicle is {distance:.2f} m from the middle, at {speed:.2f} m/s; expected at "
                f"most {MAX_DISTANCE:g} m and {MAX_SPEED:g} m/s"
            )

    def _on_control(self, message):
        added = (0.0,) * 4
        if self._begun is not None:
            added = excitation.controls(self._handle.time() - self._begun)
        if not any(added):
            self._excited.publish(message)
            return
        c = message.control
        roll, pitch, yaw_dot, thrust = added
        control = Control(
            roll=min(max(c.roll + roll, -MAX_TILT), MAX_TILT),
            pitch=min(max(c.pitch + pitch, -MAX_TILT), MAX_TILT),
            yaw_dot=c.yaw_dot + yaw_dot,
            thrust=c.thrust + thrust,
        )
        self._excited.publish(ControlStamped(header=message.header, control=control))

    def _on_timer(self):
        now = self._handle.time()
        if self._begun is None:
            is_due = self._flying_since is not None and now - self._flying_since >= SETTLED
            if is_due and not self._is_over and self._position is not None:
                self._begun, self._middle = now, self._position
                self._handle.info(f"excitation of {self._parameters.duration:g} s begins")
            return
        if now - self._begun >= self._parameters.duration:
            self._end("")
            return
        offset, velocity = excitation.reference(now - self._begun)
        self._publish([a + b for a, b in zip(self._middle, offset, strict=True)], velocity)

    def _end(self, reason):
        self._begun, self._is_over = None, True
        self._publish(self._middle, (0.0, 0.0, 0.0))
        if reason:
            self._handle.warn(f"excitation ended: {reason}")
        else:
            self._handle.info("excitation is over: land, and give the bag to identify")

    def _publish(self, position, velocity):
        state, stamp = PositionVelocityState(*position, *velocity), self._handle.stamp()
        self._references.publish(stamped(PositionVelocityStateStamped, stamp, state=state))
