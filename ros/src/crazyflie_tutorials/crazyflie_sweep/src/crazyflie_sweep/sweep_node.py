"""ROS interface of the sweep: takeoff, lanes, landing, report, and markers for RViz."""

import random

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from std_srvs.srv import Empty, EmptyRequest, Trigger, TriggerResponse
from typing_extensions import override
from visualization_msgs.msg import Marker, MarkerArray

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityState,
    PositionVelocityStateStamped,
    PositionVelocityYawStateStamped,
)
from crazyflie_sweep.sweep_parameters import SweepPlan
from crazyflie_sweep.sweeper import Sweeper
from crazyflie_sweep.velocities import VelocitySource, oscillator_velocity, random_velocities
from crazyflie_tutorial_msgs.msg import SweepReport, Vel
from crazyflie_tutorial_msgs.srv import (
    Velocity,
    VelocityAt,
    VelocityAtRequest,
    VelocityAtResponse,
    VelocityResponse,
)
from crazyflie_utils import Node, NodeHandle, Parameters, parameter, topic
from crazyflie_utils.flight_status import FlightTopics
from crazyflie_utils.parameters.declaration import group
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FRAME,
    SERVICE,
    TIME_STEP,
    Integer,
    Number,
)
from crazyflie_utils.vectors import stamped

COVERED_COLOUR = ColorRGBA(0.15, 0.65, 0.35, 0.75)
UNCOVERED_COLOUR = ColorRGBA(0.75, 0.78, 0.82, 0.6)
LANE_COLOUR = ColorRGBA(0.9, 0.45, 0.05, 1.0)

_SPACING = 0.05  #: Distance between the points with which lanes and arcs are drawn (m).

_LINE_WIDTH = 0.015
_TEXT_SIZE = 0.2
_THICKNESS = 0.002


def markers(sweeper: Sweeper, frame: str) -> MarkerArray:
    """Return the cells on the ground, the lanes and the covered fraction."""
    coverage = sweeper.coverage
    array = []
    for name, covered, colour in (
        ("covered", True, COVERED_COLOUR),
        ("not covered", False, UNCOVERED_COLOUR),
    ):
        cells = _marker(name, Marker.CUBE_LIST, colour, frame)
        cells.scale.x, cells.scale.y = coverage.cell_size
        cells.scale.z = _THICKNESS
        cells.points = [Point(x, y, 0.0) for x, y in coverage.middles(covered)]
        if not cells.points:
            cells.action = Marker.DELETE
        array.append(cells)
    path = sweeper.lanes
    lanes = _marker("lanes", Marker.LINE_STRIP, LANE_COLOUR, frame)
    lanes.scale.x = _LINE_WIDTH
    count = max(2, int(path.length / _SPACING))
    lanes.points = [Point(*path.at(s)[0]) for s in np.linspace(0.0, path.length, count)]
    label = _marker("share", Marker.TEXT_VIEW_FACING, LANE_COLOUR, frame)
    label.scale.z = _TEXT_SIZE
    label.text = f"{coverage.share:.1%}"
    end, _ = path.at(path.length)
    label.pose.position = Point(end[0], end[1], end[2] + 2.0 * _TEXT_SIZE)
    return MarkerArray([*array, lanes, label])


def _marker(name, shape, colour, frame):
    marker = Marker(ns=name, type=shape, color=colour)
    marker.header.frame_id = frame
    # The stamp remains 0: RViz uses the latest transform, even after simulated time was reset.
    marker.pose.orientation.w = 1.0
    return marker


PERIOD = 0.02  #: Period of the references (s).
ASK_PERIOD = 0.1  #: Period of the calls for a velocity (s).
REPORT_PERIOD = 0.5  #: Period of reports, and of markers for RViz (s).
STATE_LIMIT = 0.5  #: Time without a state after which the reference stands still (s).
FLIGHT_LIMIT = 120.0  #: Timeout of takeoff and landing (s of the machine's clock).
#: States in which a sweep may begin.
IDLE = (SweepReport.WAITING, SweepReport.DONE, SweepReport.FAILED)


class SweepParameters(SweepPlan):
    """Parameters of `SweepNode`."""

    velocity_limit: float = parameter(
        TIME_STEP,
        "time for which an answer of the velocity service is valid",
        0.5,
        "velocity/limit",
    )
    velocity_most: float = parameter(
        Number(above=0.0), "largest valid answer; it must also be > 0", 3.0, "velocity/most"
    )
    start: bool = parameter(
        BOOLEAN, "begin as soon as a vehicle is present; otherwise wait for `~start`", True
    )
    fixed_frame: str = parameter(FRAME, "frame of the area", "world", "frames/fixed")
    takeoff_service: str = parameter(SERVICE, "takes off", "/takeoff", "srv/takeoff")
    land_service: str = parameter(SERVICE, "lands", "/land", "srv/land")
    velocity_service: str = parameter(
        SERVICE, "service with the velocity for a position", "oscillator", "srv/velocity"
    )
    state_topic: str = topic("state", "states of the vehicle")
    reference_topic: str = topic("reference", "where references go")
    flight: FlightTopics = group(FlightTopics, "topics")
    report_topic: str = topic("report", "status of the sweep", "~report")
    velocity_topic: str = topic("velocity", "speed of the reference, as `Vel` linear", "~velocity")
    markers_topic: str = topic("markers", "for RViz", "~markers")


class SweepNode(Node[SweepParameters]):
    """Sweep an area in lanes, at velocities from a service; hover without a velocity."""

    def __init__(self) -> None:
        self._state = SweepReport.WAITING
        self._reason = ""
        self._sweeper: Sweeper | None = None
        self._position: tuple[float, float, float] | None = None
        self._position_time = 0.0
        self._flight_state: int = FlightStatus.UNKNOWN
        self._is_asking = False
        self._begin = 0.0
        self._end: float | None = None
        self._hovering = 0.0
        self._tick_time = 0.0
        self._markers_are_old = True

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        self._reference = handle.publisher(parameters.reference_topic, PositionVelocityStateStamped)
        self._report = handle.publisher(parameters.report_topic, SweepReport, latch=True)
        self._velocity = handle.publisher(parameters.velocity_topic, Vel)
        self._markers = handle.publisher(parameters.markers_topic, MarkerArray, latch=True)
        handle.advertise_service("~start", Trigger, self._on_start)
        parameters.flight.subscribe(handle, self._on_flight_status)
        handle.subscribe(
            parameters.state_topic, PositionVelocityYawStateStamped, self._on_state, finite="state"
        )
        self._publish_report()
        self._tick_time = handle.time()
        handle.timer(PERIOD, self._on_timer)
        handle.timer(ASK_PERIOD, self._ask)
        handle.timer(REPORT_PERIOD, self._publish_report)
        if parameters.start:
            self._start_timer = handle.timer(REPORT_PERIOD, self._start_when_possible)

    @override
    def enter_safe_state(self) -> None:
        """Stop the reference, so that the vehicle hovers."""
        if self._sweeper is not None and self._is_sweeping():
            self._sweeper.speed = 0.0
            self._publish_reference(self._sweeper)

    # Begin and end.

    def _start_when_possible(self):
        takeoff = self._handle.resolve(self._parameters.takeoff_service)
        if self._knows_position() and takeoff in self._handle.service_nodes():
            self._start_timer.stop()
            if self._state in IDLE:
                self._start()

    def _on_start(self, _):
        if self._state not in IDLE:
            return TriggerResponse(False, f"a sweep is under way: {self._state}")
        if not self._knows_position():
            return TriggerResponse(False, "no state of the vehicle has been received")
        self._start()
        return TriggerResponse(True, "")

    def _start(self):
        self._sweeper = None
        self._begin = self._handle.time()
        self._end = None
        self._hovering = 0.0
        if self._flight_state == FlightStatus.FLYING:
            self._sweep()
        else:
            self._set_state(SweepReport.TAKING_OFF)
            self._call(self._parameters.takeoff_service, self._sweep)

    def _call(self, service, proceed):
        def on_reply(reply):
            if reply.exception() is None:
                proceed()
            else:
                self._finish(str(reply.exception()))

        future = self._handle.call_service(service, Empty, EmptyRequest(), FLIGHT_LIMIT)
        future.add_done_callback(on_reply)

    def _sweep(self):
        if self._position is None:
            self._finish("no state of the vehicle has been received")
            return
        # The response of takeoff may come before the flight status.
        self._flight_state = FlightStatus.FLYING
        self._sweeper = Sweeper(self._parameters, self._position)
        self._source = VelocitySource(
            self._parameters.velocity_limit, self._parameters.velocity_most, self._handle.time()
        )
        self._markers_are_old = True
        self._set_state(SweepReport.SWEEPING)

    def _land(self, sweeper):
        failure, goal = "", self._parameters.coverage
        if not sweeper.is_covered:
            failure = (
                f"{sweeper.coverage.share:.1%} is covered after {goal.max_passes} passes; "
                f"expected {goal.goal:.1%}"
            )
        self._set_state(SweepReport.LANDING)
        self._call(self._parameters.land_service, lambda: self._finish(failure))

    def _finish(self, failure):
        self._end = self._handle.time()
        self._set_state(SweepReport.FAILED if failure else SweepReport.DONE, failure)
        if failure:
            self._handle.error(f"the sweep has failed: {failure}")
        report = self._publish_report()
        self._handle.info(
            f"{report.coverage:.1%} of the area is covered after {report.duration:.1f} s, "
            f"{report.hovering:.1f} s of them without a velocity; "
            f"at most {report.max_lane_distance:.3f} m from the lane"
        )

    def _set_state(self, state, reason=""):
        if (state, reason) == (self._state, self._reason):
            return
        self._state, self._reason = state, reason
        self._publish_report()

    # The flight.

    def _on_flight_status(self, status):
        self._flight_state = status.state
        if status.state != FlightStatus.FLYING and self._is_sweeping():
            self._finish(f"the flight was ended: {status.reason or 'the vehicle is being landed'}")

    def _on_state(self, message):
        self._position = (message.state.x, message.state.y, message.state.z)
        self._position_time = self._handle.time()
        if self._sweeper is not None and self._is_sweeping():
            self._markers_are_old |= self._sweeper.measure(self._position)

    def _knows_position(self):
        age = self._handle.time() - self._position_time
        return self._position is not None and abs(age) < STATE_LIMIT

    def _is_sweeping(self):
        return self._state in (SweepReport.SWEEPING, SweepReport.HOVERING)

    def _on_timer(self):
        now = self._handle.time()
        dt, self._tick_time = max(now - self._tick_time, 0.0), now
        if self._sweeper is None or not self._is_sweeping():
            return
        velocity = self._usable_velocity(now)
        if velocity is None:
            self._hovering += dt
        self._sweeper.advance(dt, velocity)
        self._publish_reference(self._sweeper)
        self._velocity.publish(Vel("linear", self._sweeper.speed))
        if self._sweeper.is_done:
            self._land(self._sweeper)

    def _usable_velocity(self, now):
        velocity = self._source.velocity(now)
        reason = self._source.reason
        service = self._handle.resolve(self._parameters.velocity_service)
        if reason and service not in reason:
            reason = f"{service}: {reason}"
        if not self._knows_position():
            velocity = None
            reason = f"no state of the vehicle has been received for {STATE_LIMIT:g} s"
        if not reason:
            if self._state == SweepReport.HOVERING:
                self._handle.info("the sweep continues")
            self._set_state(SweepReport.SWEEPING)
        elif self._state != SweepReport.HOVERING or reason != self._reason:
            self._handle.warn(f"hovering: {reason}", throttle=1.0)
            self._set_state(SweepReport.HOVERING, reason)
        return velocity

    def _publish_reference(self, sweeper):
        state, frame = PositionVelocityState(*sweeper.reference), self._parameters.fixed_frame
        stamp = self._handle.stamp()
        self._reference.publish(stamped(PositionVelocityStateStamped, stamp, frame, state=state))

    # The velocity service.

    def _ask(self):
        if self._sweeper is None or self._is_asking or not self._is_sweeping():
            return
        if self._position is None or not self._knows_position():
            return
        self._is_asking = True
        request = VelocityAtRequest(self._sweeper.service_position(self._position[0]))
        future = self._handle.call_service(
            self._parameters.velocity_service, VelocityAt, request, self._parameters.velocity_limit
        )
        future.add_done_callback(self._on_velocity)

    def _on_velocity(self, reply):
        self._is_asking = False
        if reply.exception() is None:
            self._source.answer(reply.result().vel, self._handle.time())
        else:
            self._source.fail(str(reply.exception()))

    # Reports.

    def _publish_report(self):
        sweeper = self._sweeper
        report = SweepReport(state=self._state, reason=self._reason)
        report.header.stamp = self._handle.stamp()
        report.is_final = self._state in (SweepReport.DONE, SweepReport.FAILED)
        report.hovering = self._hovering
        if self._state != SweepReport.WAITING:
            end = self._handle.time() if self._end is None else self._end
            report.duration = end - self._begin
        if sweeper is not None:
            report.coverage = sweeper.coverage.share
            report.max_lane_distance = sweeper.max_lane_distance
            if self._markers_are_old:
                self._markers_are_old = False
                self._markers.publish(markers(sweeper, self._parameters.fixed_frame))
        self._report.publish(report)
        return report


class VelocityServerParameters(Parameters):
    """Parameters of `VelocityServerNode`."""

    random_service: str = parameter(
        SERVICE, "service with two random velocities in an interval", "velocity", "srv/velocity"
    )
    oscillator_service: str = parameter(
        SERVICE,
        "service with the oscillator's velocity at a position",
        "oscillator",
        "srv/oscillator",
    )
    seed: int | None = parameter(
        Integer(0, 2**32 - 1), "seed of the random velocities; without it each run differs", None
    )


class VelocityServerNode(Node[VelocityServerParameters]):
    """Answer calls for velocities."""

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        seed = handle.random_seed() if parameters.seed is None else parameters.seed
        self._random = random.Random(seed)
        handle.advertise_service(parameters.random_service, Velocity, self._on_random)
        handle.advertise_service(parameters.oscillator_service, VelocityAt, self._on_oscillator)

    def _on_random(self, request):
        return VelocityResponse(*random_velocities(request.min, request.max, self._random))

    def _on_oscillator(self, request):
        return VelocityAtResponse(oscillator_velocity(request.x))
