"""Step 4: the mission."""

from typing_extensions import override

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_utils import Node, NodeHandle
from my_sweep.lanes import Area, Walker, corners

AREA = Area(-1.5, 1.5, -1.5, 1.5)
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


class SweepNode(Node):
    """Sweep the area while the vehicle flies, then land it."""

    def __init__(self) -> None:
        self._position: tuple[float, float] | None = None
        self._walker: Walker | None = None
        self._speed = 0.0

    @override
    def load_parameters(self, handle: NodeHandle) -> None:
        """There are none."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        self._reference = handle.publisher("ref", PositionVelocityStateStamped)
        handle.subscribe("state", PositionVelocityYawStateStamped, self._on_state, finite="state")
        handle.subscribe("in_flight_flight_status", FlightStatus, self._on_flight_status)
        handle.timer(TIME_STEP, self._on_timer)

    def _on_state(self, message):
        self._position = (message.state.x, message.state.y)

    def _on_flight_status(self, message):
        if message.state != FlightStatus.FLYING:
            self._walker = None
        elif self._walker is None and self._position is not None:
            self._walker, self._speed = Walker(self._position, corners(AREA, WIDTH)), 0.0

    def _on_timer(self):
        if self._walker is None or self._walker.is_done:
            return
        # Step 4: advance the walker and publish the reference; at the end call /land; otherwise
        # call /my_oscillator: handle.call_service(name, type, request, limit) returns a Future, and
        # future.add_done_callback(self._on_velocity) has its answer handed on.

    def _on_velocity(self, answer):
        # Step 5: set self._speed, from SLOWEST to FASTEST; 0 if answer.exception() is not None.
        raise NotImplementedError("step 5")
