"""ROS interface of the geofence."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from crazyflie_geofence.geofence import MAX_HORIZONTAL_BRAKING, MAX_VERTICAL_BRAKING, Geofence
from crazyflie_msgs.msg import (
    Control,
    ControlStamped,
    PositionVelocityYawStateStamped,
    PrioritizedControl,
    PrioritizedControlStamped,
)
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import Number
from crazyflie_utils.vectors import from_vector, to_vector

# Without these bounds the fence's equations overflow or divide by nothing.
_COORDINATE = Number("m", minimum=-1e9, maximum=1e9)
_REACTION_TIME = Number("s", minimum=0.001, maximum=100.0)
_MIN_BRAKING = 0.01  #: m/s^2


_CORNER_HELP = "lowest and highest corner, in the frame of the state"


class CornerParameters(Parameters):
    """A corner of the box."""

    x: float = parameter(_COORDINATE, _CORNER_HELP, live=True)
    y: float = parameter(_COORDINATE, _CORNER_HELP, live=True)
    z: float = parameter(_COORDINATE, _CORNER_HELP, live=True)

    def vector(self) -> tuple[float, float, float]:
        """Return x, y, z in m."""
        return self.x, self.y, self.z


class GeofenceParameters(Parameters):
    """Parameters of `GeofenceNode`."""

    state_topic: str = topic("state", "where states come from")
    control_topic: str = topic("control", "where regular controls come from")
    prioritized_topic: str = topic("prioritized_control", "where the fence's controls go")
    lower: CornerParameters = group(CornerParameters, "box/min")
    upper: CornerParameters = group(CornerParameters, "box/max")
    margin: float = parameter(
        Number("m", minimum=0.001),
        "the fence acts when the stopping point is nearer to a wall than this; at most half "
        "the box's width",
        0.5,
        live=True,
    )
    horizontal_braking: float = parameter(
        Number("m/s^2", minimum=_MIN_BRAKING, maximum=MAX_HORIZONTAL_BRAKING),
        "deceleration b along x and y",
        1.5,
        "braking/horizontal",
        live=True,
    )
    vertical_braking: float = parameter(
        Number("m/s^2", minimum=_MIN_BRAKING, maximum=MAX_VERTICAL_BRAKING),
        "deceleration b along z; less for a vehicle that is heavy",
        4.0,
        "braking/vertical",
        live=True,
    )
    horizontal_reaction_time: float = parameter(
        _REACTION_TIME,
        "reaction time T along x and y: estimator, attitude loop, motors",
        0.4,
        "reaction_time/horizontal",
        live=True,
    )
    vertical_reaction_time: float = parameter(
        _REACTION_TIME, "T along z", 0.2, "reaction_time/vertical", live=True
    )
    recovery_rate: float = parameter(
        Number("1/s", above=0.0, maximum=1000.0),
        "how quickly the stopping point is brought back",
        1.0,
        live=True,
    )

    @override
    def complaints(self) -> Iterator[str]:
        corners = zip("xyz", self.lower.vector(), self.upper.vector(), strict=True)
        for axis, low, high in corners:
            if high - low < 2.0 * self.margin:
                yield (
                    f"box/max/{axis} is {high}; expected at least "
                    f"{low + 2.0 * self.margin:g} m, which is box/min/{axis} and twice the margin"
                )

    def geofence(self) -> Geofence:
        """Return the fence."""
        return Geofence(
            self.lower.vector(),
            self.upper.vector(),
            self.margin,
            (self.horizontal_braking, self.horizontal_reaction_time),
            (self.vertical_braking, self.vertical_reaction_time),
            self.recovery_rate,
        )


class GeofenceNode(Node[GeofenceParameters]):
    """Answer every state with a prioritised control that keeps the vehicle in a box.

    Silent until there is a regular control: without one, the merger is silent too.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._regular: NDArray[np.float64] | None = None

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._fence = parameters.geofence()
        self._publisher = handle.publisher(parameters.prioritized_topic, PrioritizedControlStamped)
        handle.subscribe(
            parameters.control_topic, ControlStamped, self._on_control, finite="control"
        )
        handle.subscribe(
            parameters.state_topic, PositionVelocityYawStateStamped, self._on_state, finite="state"
        )

    def _reconfigure(self, parameters):
        self._fence = parameters.geofence()

    def _on_control(self, message):
        self._regular = to_vector(message.control)

    def _on_state(self, message):
        if self._regular is None:
            return
        x = to_vector(message.state)
        u, priority = self._fence.control(x[:3], x[3:6], x[6], self._regular)
        prioritized = PrioritizedControlStamped(
            control=PrioritizedControl(from_vector(Control, u), priority)
        )
        prioritized.header.stamp = message.header.stamp
        self._publisher.publish(prioritized)
