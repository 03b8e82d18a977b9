"""Step 4: the mission."""

import math

from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_sweep.sweep_parameters import Area
from crazyflie_tutorial_msgs.srv import VelocityAt, VelocityAtRequest
from crazyflie_utils import Node, NodeHandle
from my_sweep.lanes import LanePath, Line, Point, sweep
from my_sweep.oscillator import service_position

AREA = Area.from_mapping({"x_min": -1.5, "x_max": 1.5, "y_min": -1.5, "y_max": 1.5})
WIDTH = 1.0
HEIGHT = 1.0
"""Of the lanes, and above the ground, m."""

SCALE = (AREA.x_max - AREA.x_min) / 7.0
"""Of the service's velocities: a lane is 7 of its units long."""

SLOWEST, FASTEST = 0.2, 0.7
"""m/s."""

TIME_STEP = 0.1
LANDING_LIMIT = 30.0
"""s."""

NEAR = 0.01
"""From here to the first lane no line is needed, m."""


def path_from(start: Point) -> LanePath:
    """Return the path: a straight line from ``start`` to the first lane, then the sweep."""
    lanes = sweep(AREA, WIDTH, HEIGHT)
    begin, _ = lanes.at(0.0)
    if math.dist(start, begin) < NEAR:
        return lanes
    return LanePath([Line(start, begin, is_lane=False), *lanes.segments])


class SweepNode(Node):
    """Sweep the area while the vehicle flies, then land it."""

    def __init__(self) -> None:
        self._position: Point | None = None
        self._path: LanePath | None = None
        self._way = 0.0
        """Along the path, m."""
        self._speed = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """There are no parameters."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._reference = handle.publisher("ref", PositionVelocityStateStamped)
        handle.subscribe("state", PositionVelocityYawStateStamped, self._on_state, finite="state")
        handle.subscribe("in_flight_flight_status", FlightStatus, self._on_flight_status)
        handle.timer(TIME_STEP, self._on_timer)

    def _on_state(self, message):
        self._position = (message.state.x, message.state.y, HEIGHT)

    def _on_flight_status(self, message):
        if message.state != FlightStatus.FLYING:
            self._path = None
        elif self._path is None and self._position is not None:
            self._path, self._way, self._speed = path_from(self._position), 0.0, 0.0

    def _on_timer(self):
        if self._path is None or self._way >= self._path.length:
            return
        self._way += self._speed * TIME_STEP
        (x, y, z), (ux, uy, _) = self._path.at(self._way)
        state = PositionVelocityState(x, y, z, self._speed * ux, self._speed * uy, 0.0)
        message = PositionVelocityStateStamped(state=state)
        message.header.stamp = self._handle.stamp()
        self._reference.publish(message)
        if self._way >= self._path.length:
            self._handle.info("all lanes are flown; landing")
            self._handle.call_service("land", Empty, EmptyRequest(), LANDING_LIMIT)
            return
        request = VelocityAtRequest(service_position(x, AREA.x_min, AREA.x_max))
        answer = self._handle.call_service("my_oscillator", VelocityAt, request, 0.5)
        answer.add_done_callback(self._on_velocity)

    def _on_velocity(self, answer):
        fault = answer.exception()
        if fault is None and not math.isfinite(answer.result().vel):
            fault = f"the velocity is {answer.result().vel}; expected a finite number"
        if fault is not None:
            self._speed = 0.0
            self._handle.warn(f"hovering: {fault}", throttle=1.0)
            return
        self._speed = min(max(answer.result().vel * SCALE, SLOWEST), FASTEST)
