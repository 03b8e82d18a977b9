"""ROS interface of the geofence, which `geofence` explains and docs/geofence_proof.md proves."""

from collections.abc import Iterator
from functools import cached_property, partial

import genpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import Header
from typing_extensions import override

from crazyflie_geofence import bounds
from crazyflie_geofence.bounds import PERIOD, SPREAD, Bounds
from crazyflie_geofence.geofence import (
    Control,
    Geofence,
    max_horizontal_braking,
    max_vertical_braking,
)
from crazyflie_geofence.obstacles import Obstacles
from crazyflie_geofence.viable_set import Axis
from crazyflie_model.limits import HOLD_LIMIT
from crazyflie_msgs.msg import Control as ControlMessage
from crazyflie_msgs.msg import (
    ControlStamped,
    PositionVelocityYawStateStamped,
    PrioritizedControl,
    PrioritizedControlStamped,
)
from crazyflie_utils import Node, NodeHandle, ParameterError, Parameters, parameter, topic
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import TOPIC, ListOf, Number
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL
from crazyflie_utils.vectors import to_tuple
from crazyflie_world.world import World
from crazyflie_world.world_file import WORLD_FILE

_COORDINATE = Number("m", minimum=-1e9, maximum=1e9)
_BRAKING = Number("m/s^2", minimum=0.01)
_CORNER_HELP = "lowest and highest corner, in the frame of the state"
_REPORT_PERIOD = 1.0  #: Of diagnostics (s).


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
    final_topic: str | None = topic(
        "final_control",
        "controls that the vehicle is sent; by default the fence takes them to be its own, or the "
        "regular ones",
        None,
    )
    lower: CornerParameters = group(CornerParameters, "box/min")
    upper: CornerParameters = group(CornerParameters, "box/max")
    horizontal_braking: float = parameter(
        _BRAKING, "A: acceleration along x and y that it counts on", 1.4, "braking/horizontal", True
    )
    vertical_braking: float = parameter(
        _BRAKING, "A along z; what is more leaves less along x and y", 2.0, "braking/vertical", True
    )
    model: str = parameter(
        VEHICLE_MODEL, "type of the vehicle, or model file with its bounds", "cf21"
    )
    bounds: Bounds = group(Bounds, "bounds")
    world: World | None = parameter(
        WORLD_FILE, "obstacles, a YAML file of crazyflie_world: those that do not move", None
    )
    clearance: float = parameter(
        Number("m", minimum=0.0), "from the vehicle's middle to what may touch no obstacle", 0.1
    )
    others: tuple[str, ...] = parameter(
        ListOf(TOPIC),
        "states of other vehicles: each has half of the room between it and this one",
        (),
        "topics/others",
    )
    buffer: float = parameter(
        Number("m", minimum=0.0), "what this vehicle keeps free of its half", 0.15
    )
    spread: float = parameter(
        Number("s", minimum=0.0, maximum=0.1),
        "how much later than after the delay a control may take effect: merger and fence answer "
        "in any order",
        SPREAD,
    )
    period: float = parameter(
        Number("s", minimum=0.001, maximum=0.1), "longest time from one state to the next", PERIOD
    )

    @override
    def complaints(self) -> Iterator[str]:
        try:
            axes = self.axes
        except ParameterError as error:
            yield from error.complaints
            return
        for name, value, most in (
            ("vertical", self.vertical_braking, max_vertical_braking(self.max_thrust)),
            ("horizontal", self.horizontal_braking, max_horizontal_braking(self.vertical_braking)),
        ):
            if value > most:
                yield (
                    f"braking/{name} is {value:g}; expected at most {most:.4g} m/s^2, which the "
                    "limits of tilt and thrust leave beside the other axes"
                )
        corners = zip("xyz", self.lower.vector(), self.upper.vector(), axes, strict=True)
        for name, low, high, axis in corners:
            if axis.disturbance >= axis.braking:
                yield (
                    f"the disturbance along {name} is {axis.disturbance:g} m/s^2; expected less "
                    f"than the braking there, {axis.braking:g} m/s^2"
                )
            elif high - low < axis.smallest_box:
                yield (
                    f"box/max/{name} is {high}; expected at least {low + axis.smallest_box:.4g} m: "
                    f"the proof needs {axis.smallest_box:.2f} m between the walls"
                )

    @cached_property
    def axes(self) -> tuple[Axis, Axis, Axis]:
        """Bounds of x, y and z; `ParameterError` if the model does not have all of them."""
        known = bounds.complete(self.bounds, self.model)
        braking = self.horizontal_braking, self.vertical_braking
        return bounds.axes(known, *braking, self.spread, self.period)

    @cached_property
    def max_thrust(self) -> float:
        """Largest thrust over the mass of the vehicle, m/s^2."""
        return bounds.max_thrust(self.model)


class GeofenceNode(Node[GeofenceParameters]):
    """Answer every state with a prioritised control that keeps the vehicle in a box.

    Silent until there is a regular control: without one, the merger is silent too. A controller
    that has answered the last state is waited for, until the next state: with its control of the
    state before, a vehicle near a wall would fly a period behind it.
    """

    needed_in_flight = True

    def __init__(self) -> None:
        self._regular: Control | None = None
        self._regular_stamp = genpy.Time()
        self._stamp: genpy.Time | None = None  # Of the last state.
        #: What arrived when, and was not answered.
        self._waiting: tuple[float, PositionVelocityYawStateStamped] | None = None
        self._yaw = 0.0
        self._others: dict[str, tuple[float, tuple[float, float, float]]] = {}

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        own = self._parameters
        solids = () if own.world is None else own.world.objects
        obstacles = Obstacles([each for each in solids if each.path is None], own.clearance)
        self._fence = Geofence(
            own.lower.vector(), own.upper.vector(), own.axes, own.max_thrust, obstacles
        )
        self._fence.buffer = own.buffer
        self._publisher = handle.publisher(own.prioritized_topic, PrioritizedControlStamped)
        self._diagnostics = handle.publisher("/diagnostics", DiagnosticArray)
        handle.subscribe(own.control_topic, ControlStamped, self._on_control, finite="control")
        if own.final_topic is not None:
            handle.subscribe(own.final_topic, ControlStamped, self._on_final, finite="control")
        handle.subscribe(
            own.state_topic, PositionVelocityYawStateStamped, self._on_state, finite="state"
        )
        for other in own.others:
            on_other = partial(self._on_other, other)
            handle.subscribe(other, PositionVelocityYawStateStamped, on_other, finite="state")
        handle.timer(_REPORT_PERIOD, self._report)

    def _reconfigure(self, parameters):
        self._fence.change(parameters.lower.vector(), parameters.upper.vector(), parameters.axes)

    def _on_other(self, name, message):
        x, y, z, *_ = to_tuple(message.state)
        self._others[name] = self._handle.time(), (x, y, z)

    def _on_control(self, message):
        self._regular, self._regular_stamp = to_tuple(message.control), message.header.stamp
        if self._waiting is not None:
            self._answer(*self._waiting, self._regular)

    def _on_final(self, message):
        self._fence.sent(self._handle.time(), to_tuple(message.control), self._yaw)

    def _on_state(self, message):
        self._waiting = self._handle.time(), message
        follows = self._regular_stamp == self._stamp
        self._stamp = message.header.stamp
        if self._regular is not None and (not follows or self._regular_stamp == self._stamp):
            self._answer(*self._waiting, self._regular)

    def _answer(self, now, message, regular):
        self._waiting = None
        x, y, z, vx, vy, vz, self._yaw = to_tuple(message.state)
        self._fence.others = [p for t, p in self._others.values() if 0.0 <= now - t < HOLD_LIMIT]
        u, priority = self._fence.control(now, (x, y, z), (vx, vy, vz), self._yaw, regular)
        if self._parameters.final_topic is None:
            self._fence.sent(now, u, self._yaw)
        prioritized = PrioritizedControlStamped(
            control=PrioritizedControl(ControlMessage(*u), priority)
        )
        prioritized.header.stamp = message.header.stamp
        self._publisher.publish(prioritized)

    def _report(self):
        excess = self._fence.excess()
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if excess else DiagnosticStatus.OK,
            name=f"{self._handle.name.lstrip('/')}: certificate",
            message="the vehicle moves within the bounds of the fence",
        )
        if excess:
            status.message = "the box is not certain: " + ", ".join(
                f"disturbance along {axis} {seen:.1f} m/s^2, bound {bound:g}"
                for axis, seen, bound in excess
            )
        header = Header(stamp=self._handle.stamp())
        self._diagnostics.publish(DiagnosticArray(header=header, status=[status]))
