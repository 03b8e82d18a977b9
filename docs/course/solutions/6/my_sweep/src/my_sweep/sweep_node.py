"""Step 4: the mission."""

from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_tutorial_msgs.srv import VelocityAt, VelocityAtRequest
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
        self._walker.advance(self._speed * TIME_STEP)
        x, y = self._walker.position
        message = PositionVelocityStateStamped(state=PositionVelocityState(x=x, y=y, z=HEIGHT))
        message.header.stamp = self._handle.stamp()
        self._reference.publish(message)
        if self._walker.is_done:
            self._handle.info("all lanes are flown; landing")
            self._handle.call_service("land", Empty, EmptyRequest(), LANDING_LIMIT)
            return
        request = VelocityAtRequest(AREA.service_position(x))
        answer = self._handle.call_service("my_oscillator", VelocityAt, request, 0.5)
        answer.add_done_callback(self._on_velocity)

    def _on_velocity(self, answer):
        if answer.exception() is not None:
            self._speed = 0.0
            self._handle.warn(f"hovering: {answer.exception()}", throttle=1.0)
            return
        self._speed = min(max(answer.result().vel * SCALE, SLOWEST), FASTEST)
