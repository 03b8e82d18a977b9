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
        # Step 4: move self._way on by what self._speed makes in TIME_STEP; publish where the path
        # is there, with its velocity. At the end call /land (std_srvs/Empty), otherwise call
        # /my_oscillator for the x of the path there, and have the answer handed to
        # self._on_velocity.

    def _on_velocity(self, answer):
        # Step 5: set self._speed, from SLOWEST to FASTEST; 0 if answer.exception() is not None, or
        # if the velocity is not finite.
        raise NotImplementedError("step 5")
