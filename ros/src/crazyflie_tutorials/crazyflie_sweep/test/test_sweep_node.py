"""The sweep's node and launch file, without a master."""

import itertools
import math
from concurrent.futures import Future
from pathlib import Path

import pytest
import rospkg
from std_srvs.srv import EmptyResponse, TriggerRequest

from crazyflie_msgs.msg import (
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_sweep.sweep_node import SweepNode, VelocityServerNode
from crazyflie_sweep.sweep_parameters import SweepPlan
from crazyflie_tutorial_msgs.msg import SweepReport
from crazyflie_tutorial_msgs.srv import VelocityAtResponse
from crazyflie_utils import ServiceError
from crazyflie_utils.main import NODE_CLASSES
from crazyflie_utils.testing import FakeProcess, launch_files

PARAMETERS = {
    "topics/state": "/state",
    "topics/reference": "/ref",
    "area/x_min": 0.0,
    "area/x_max": 0.8,
    "area/y_min": 0.0,
    "area/y_max": 0.8,
}
STEP = 0.1
LIMIT = 120.0


class Flight:
    """A vehicle and its takeoff server, around a sweep."""

    def __init__(self, parameters=(), velocity=None):
        self.process = FakeProcess()
        self.calls = []
        self.follows = True
        self.speaks = True
        services = self.process.transport.services
        services["/takeoff"] = lambda _: self.answer("takeoff", "flying")
        services["/land"] = lambda _: self.answer("land", "on_ground")
        if velocity is None:
            assert self.process.launch(VelocityServerNode(), "/velocity_server")
        else:
            services["/oscillator"] = velocity
        assert self.process.launch(SweepNode(), "/sweep", {**PARAMETERS, **dict(parameters)})
        self.position = (0.0, 0.0, 1.0)

    def answer(self, name, state):
        self.calls.append(name)
        future = Future()
        future.set_result(EmptyResponse())
        self.publish_status(getattr(FlightStatus, state.upper()))
        return future

    def publish_status(self, state):
        self.process.publish("/in_flight_flight_status", FlightStatus(state=state))

    def step(self):
        references = self.process.published("/ref")
        if references and self.follows:
            state = references[-1].state
            self.position = (state.x, state.y, state.z)
        if self.speaks:
            x, y, z = self.position
            state = PositionVelocityYawState(x=x, y=y, z=z)
            self.process.publish("/state", PositionVelocityYawStateStamped(state=state))
        self.process.advance(STEP)

    def until(self, *states):
        for _ in range(int(LIMIT / STEP)):
            self.step()
            if self.report.state in states:
                return self.report
        raise AssertionError(f"not {states} within {LIMIT:g} s: {self.report}")

    def for_seconds(self, duration):
        for _ in range(round(duration / STEP)):
            self.step()

    @property
    def report(self):
        return self.process.published("/sweep/report")[-1]

    @property
    def speed(self):
        state = self.process.published("/ref")[-1].state
        return math.hypot(state.x_dot, state.y_dot, state.z_dot)


def reply(value):
    """Return what a service answers with at once."""
    future = Future()
    if isinstance(value, Exception):
        future.set_exception(value)
    else:
        future.set_result(VelocityAtResponse(value))
    return future


def test_a_whole_mission():
    flight = Flight()
    report = flight.until(SweepReport.DONE, SweepReport.FAILED)
    states = [each.state for each in flight.process.published("/sweep/report")]
    assert [state for state, _ in itertools.groupby(states)] == [
        "waiting",
        "taking_off",
        "sweeping",
        "landing",
        "done",
    ]
    assert (report.state, report.reason, report.is_final) == (SweepReport.DONE, "", True)
    assert report.coverage == 1.0
    assert report.max_lane_distance < 0.1
    assert 10.0 < report.duration < 60.0
    assert report.hovering < 0.2
    assert flight.calls == ["takeoff", "land"]
    messages = flight.process.published("/sweep/velocity")
    assert {message.name for message in messages} == {"linear"}
    state = flight.process.published("/ref")[50].state
    assert messages[50].vel == pytest.approx(math.hypot(state.x_dot, state.y_dot, state.z_dot))
    assert messages[50].vel > 0.0
    flight.for_seconds(2.0)
    assert flight.report.duration == report.duration
    assert flight.calls == ["takeoff", "land"]


def test_rviz_sees_cells_turn():
    flight = Flight()
    flight.until(SweepReport.DONE)
    pictures = [
        {marker.ns: marker for marker in array.markers}
        for array in flight.process.published("/sweep/markers")
    ]
    counts = [(len(p["covered"].points), len(p["not covered"].points)) for p in pictures]
    assert counts[0][1] > 30
    assert counts[-1] == (64, 0)
    assert all(covered + left == 64 for covered, left in counts)
    assert pictures[-1]["share"].text == "100.0%"
    assert len(pictures[-1]["lanes"].points) > 20
    assert pictures[-1]["lanes"].header.frame_id == "world"


def test_without_the_service_it_hovers_until_the_service_is_there():
    flight = Flight(velocity=lambda _: reply(ServiceError("there is no service /oscillator")))
    report = flight.until(SweepReport.HOVERING)
    flight.for_seconds(3.0)
    assert report.reason == "there is no service /oscillator"
    assert any("hovering: there is no service" in t for t in flight.process.logged("warn"))
    assert flight.speed == 0.0
    del flight.process.transport.services["/oscillator"]
    assert flight.process.launch(VelocityServerNode(), "/velocity_server")
    report = flight.until(SweepReport.DONE)
    assert report.coverage == 1.0
    assert report.hovering > 2.5


@pytest.mark.parametrize("nonsense", [math.nan, math.inf, -0.5, 0.0, 50.0])
def test_nonsense_makes_it_hover(nonsense):
    answers = itertools.chain([1.0] * 50, itertools.repeat(nonsense))
    flight = Flight(velocity=lambda _: reply(next(answers)))
    flight.until(SweepReport.SWEEPING)
    flight.for_seconds(4.0)
    assert flight.report.state == SweepReport.SWEEPING
    report = flight.until(SweepReport.HOVERING)
    assert f"answers {nonsense:g}" in report.reason
    flight.for_seconds(3.0)
    assert flight.speed == 0.0
    at_rest = flight.process.published("/ref")[-1].state
    flight.for_seconds(3.0)
    assert flight.process.published("/ref")[-1].state == at_rest
    assert flight.calls == ["takeoff"]


def test_a_slow_service_makes_it_hover():
    flight = Flight(velocity=lambda _: Future())
    report = flight.until(SweepReport.HOVERING)
    assert report.reason == "/oscillator has not answered within 0.5 s"
    flight.for_seconds(3.0)
    assert flight.speed == 0.0


def test_without_states_it_hovers():
    flight = Flight()
    flight.until(SweepReport.SWEEPING)
    flight.for_seconds(3.0)
    flight.speaks = False
    report = flight.until(SweepReport.HOVERING)
    assert report.reason == "no state of the vehicle has been received for 0.5 s"
    flight.for_seconds(3.0)
    assert flight.speed == 0.0
    flight.speaks = True
    flight.until(SweepReport.DONE)


def test_a_landing_ends_the_sweep():
    flight = Flight()
    flight.until(SweepReport.SWEEPING)
    flight.publish_status(FlightStatus.DESCENDING)
    assert flight.report.state == SweepReport.FAILED
    assert flight.report.reason == "the flight was ended: the vehicle is being landed"
    count = len(flight.process.published("/ref"))
    flight.for_seconds(3.0)
    assert len(flight.process.published("/ref")) == count
    assert flight.calls == ["takeoff"]


def test_a_refused_takeoff_is_reported():
    flight = Flight({"start": False})
    flight.process.transport.services["/takeoff"] = lambda _: reply(ServiceError("refused: no"))
    flight.step()
    assert flight.process.call("/sweep/start", TriggerRequest()).success
    assert (flight.report.state, flight.report.reason) == (SweepReport.FAILED, "refused: no")
    assert "refused: no" in flight.process.logged("error")[0]
    del flight.process.published("/ref")[:]
    flight.for_seconds(1.0)
    assert flight.process.published("/ref") == []


def test_a_goal_out_of_reach_is_reported_after_the_last_pass():
    flight = Flight({"coverage/swath": 0.2, "coverage/max_passes": 1})
    report = flight.until(SweepReport.FAILED)
    assert report.coverage < 0.9
    assert "is covered after 1 passes; expected 99.0%" in report.reason
    assert flight.calls == ["takeoff", "land"]


def test_waits_for_start_and_flies_again():
    flight = Flight({"start": False})
    assert not flight.process.call("/sweep/start", TriggerRequest()).success
    flight.for_seconds(3.0)
    assert flight.report.state == SweepReport.WAITING
    for count in (1, 2):
        assert flight.process.call("/sweep/start", TriggerRequest()).success
        refusal = flight.process.call("/sweep/start", TriggerRequest())
        assert (refusal.success, refusal.message) == (False, "a sweep is under way: sweeping")
        assert flight.until(SweepReport.DONE).coverage == 1.0
        assert flight.calls == ["takeoff", "land"] * count


def test_in_flight_it_does_not_take_off():
    flight = Flight({"start": False})
    flight.publish_status(FlightStatus.FLYING)
    flight.step()
    flight.process.call("/sweep/start", TriggerRequest())
    flight.until(SweepReport.DONE)
    assert flight.calls == ["land"]


def test_a_fault_leaves_the_reference_at_rest():
    answers = itertools.chain([reply(1.0)] * 60, itertools.repeat(reply("no number")))
    flight = Flight(velocity=lambda _: next(answers))
    flight.until(SweepReport.SWEEPING)
    flight.for_seconds(4.0)
    assert flight.speed > 0.0
    flight.for_seconds(4.0)
    assert "TypeError" in flight.process.logged("error")[0]
    # Between the fault and the next tick there is one at rest.
    assert 0.0 in [
        math.hypot(m.state.x_dot, m.state.y_dot) for m in flight.process.published("/ref")[-200:]
    ]


@pytest.mark.parametrize(
    ("name", "value", "complaint"),
    [
        ("area/x_max", -1.0, "area/x_min is 0; expected < area/x_max, -1 (m)"),
        ("speed/min", 2.0, "speed/min is 2; expected <= speed/max, 0.7 (m/s)"),
        ("lane_width", 0.0, "lane_width is 0.0; expected a finite number > 0 (m)"),
        ("coverage/goal", 1.5, "coverage/goal is 1.5; expected a finite number > 0 and <= 1"),
    ],
)
def test_bad_parameters_are_named(name, value, complaint):
    process = FakeProcess()
    assert not process.launch(SweepNode(), "/sweep", {**PARAMETERS, name: value})
    assert complaint in process.logged("error")[0]


LAUNCH = Path(rospkg.RosPack().get_path("crazyflie_sweep")) / "launch" / "sweep.launch"


@pytest.mark.parametrize("composed", ["false", "true"])
@pytest.mark.parametrize("flight", ["sw_hover.launch", "virtual_hw_hover.launch"])
def test_launch_file(composed, flight):
    nodes, parameters = launch_files.expand(LAUNCH, composed=composed, flight=flight, rviz="false")
    assert ("/sweep" in nodes) == (composed == "false")
    process = FakeProcess(parameters)
    assert process.launch(SweepNode(), "/sweep"), process.logged("error")
    if composed == "true":
        listed = NODE_CLASSES(launch_files.composed_nodes(parameters))
        assert listed["sweep"] is SweepNode
        assert listed["velocity_server"] is VelocityServerNode


def test_the_configuration_is_the_default():
    _, parameters = launch_files.expand(LAUNCH, rviz="false")
    node = SweepNode()
    assert FakeProcess(parameters).launch(node, "/sweep")
    for name in ("area", "lane_width", "height", "speed", "coverage"):
        assert getattr(node._parameters, name) == getattr(SweepPlan.from_mapping({}), name)
