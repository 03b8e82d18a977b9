"""The takeoff control filter on a fake process."""

import math

import pytest
from dynamic_reconfigure.msg import Config, DoubleParameter
from flight_words import texts
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest
from takeoff_helpers import FILTER, control

from crazyflie_msgs.msg import (
    FilterStatus,
    FlightStatus,
    PositionVelocityYawState,
    PositionVelocityYawStateStamped,
)
from crazyflie_takeoff import flight_topics
from crazyflie_takeoff.phases import FlightState
from crazyflie_takeoff.takeoff_control_filter_node import (
    LISTENING_TIME,
    SERVER_LIMIT,
    TakeoffControlFilterNode,
)
from crazyflie_utils.testing import FakeProcess


def launch(**parameters):
    """Return a process with a filter in it that has just started."""
    process = FakeProcess()
    process.transport.unpublished.add("/in_flight_flight_status")
    assert process.launch(TakeoffControlFilterNode(), "/filter", {**FILTER, **parameters})
    return process


@pytest.fixture
def process():
    """Return a process with a filter that has listened."""
    process = launch()
    process.advance(LISTENING_TIME)
    return process


def thrusts(process):
    return [message.control.thrust for message in process.published("/control/final")]


def memory(process):
    return texts(process.published("/in_flight_filter_status"))


@pytest.mark.parametrize("name", FILTER)
def test_required_parameters(name):
    process = FakeProcess()
    parameters = {key: value for key, value in FILTER.items() if key != name}
    assert not process.launch(TakeoffControlFilterNode(), "/filter", parameters)
    assert f"/filter/{name} is not set" in process.logged("error")[0]


@pytest.mark.parametrize("name", [*FILTER, "topics/flight_status", "topics/filter_status"])
@pytest.mark.parametrize("value", ["", 3, "no name"])
def test_bad_parameters_are_named(name, value):
    process = FakeProcess()
    assert not process.launch(TakeoffControlFilterNode(), "/filter", {**FILTER, name: value})
    assert f"/filter/{name} is {value!r}; expected" in process.logged("error")[0]


def test_contract_with_toggles(process):
    process.publish("/control/lqr", control(1.0))
    process.publish("/control/takeoff", control(10.0))
    process.publish("/control/lqr", control(2.0))
    assert thrusts(process) == [1.0, 10.0, 10.0]
    process.advance(0.505)
    # A takeoff control that is late is not kept above hover.
    faded = thrusts(process)[3:]
    assert faded == sorted(faded, reverse=True)
    assert faded[-1] == pytest.approx(9.81)
    del process.published("/control/final")[3:]
    process.publish("/control/lqr", control(3.0))
    process.publish("/in_flight", Empty())
    process.publish("/control/takeoff", control(11.0))
    process.publish("/control/lqr", control(4.0))
    process.publish("/in_flight", Empty())
    process.publish("/control/lqr", control(5.0))
    assert thrusts(process)[3:] == [3.0, 11.0, 4.0, 11.0]


def test_messages_are_passed_on_as_they_are(process):
    message = control(1.0)
    message.header.stamp.secs = 42
    process.publish("/control/lqr", message)
    assert process.published("/control/final") == [message]


def test_controls_are_limited_to_the_limits_of_the_model(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("limits: {tilt: 0.2, yaw_rate: 1.0, thrust: 13.0}\n")
    process = launch(model=str(path))
    process.advance(LISTENING_TIME)
    message = control(15.0)
    message.control.roll, message.control.pitch, message.control.yaw_dot = 0.25, -0.25, 2.0
    process.publish("/control/lqr", message)
    last = process.published("/control/final")[-1].control
    assert (last.roll, last.pitch, last.yaw_dot, last.thrust) == (0.2, -0.2, 1.0, 13.0)


@pytest.mark.parametrize("field", ["roll", "pitch", "yaw_dot", "thrust"])
@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_controls_that_are_not_finite_are_never_passed_on(process, field, bad):
    for topic in ("/control/takeoff", "/control/lqr"):
        for _ in range(10):
            message = control(9.0)
            setattr(message.control, field, bad)
            process.publish(topic, message)
    assert thrusts(process) == []
    takeoff, lqr = dict.fromkeys(process.logged("warn"))
    assert "/control/takeoff" in takeoff
    assert "/control/lqr" in lqr


def test_a_takeoff_control_that_is_not_finite_does_not_keep_the_controller_out(process):
    process.publish("/control/takeoff", control(10.0))
    process.advance(0.4)
    process.publish("/control/takeoff", control(math.nan))
    process.advance(0.105)
    process.publish("/control/lqr", control(2.0))
    assert (thrusts(process)[0], thrusts(process)[-1]) == (10.0, 2.0)


def test_listens_at_first():
    process = launch()
    process.publish("/control/lqr", control(1.0))
    process.publish("/control/lqr", control(2.0))
    process.advance(LISTENING_TIME - 0.01)
    process.publish("/control/lqr", control(2.0))
    assert thrusts(process) == []
    process.advance(0.01)
    assert thrusts(process) == [2.0]
    process.publish("/control/lqr", control(3.0))
    process.advance(1.0)
    assert thrusts(process) == [2.0, 3.0]


def test_remembers_the_flight_state_for_the_server(process):
    assert memory(process) == ["unknown"]
    for code in (FlightStatus.TAKING_OFF, FlightStatus.FLYING):
        process.publish("/in_flight_flight_status", FlightStatus(state=code))
    process.publish("/in_flight", Empty())
    assert memory(process) == ["unknown", "taking_off", "flying"]


def test_publishes_its_status(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.advance(0.2)
    process.advance(2.0)
    all_statuses = process.published("/in_flight_filter_status")
    statuses = [each for each in all_statuses if each.flight_state == FlightStatus.FLYING]
    assert [each.state for each in statuses] == [
        FilterStatus.PASSING,
        FilterStatus.HOLDING,
        FilterStatus.SINKING,
    ]
    assert statuses[0].reason == ""
    assert statuses[-1].reason.startswith("no control came for 1.6 s")
    assert [each.is_commanded for each in statuses] == [False] * 3
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.UNKNOWN))
    assert process.published("/in_flight_filter_status") == all_statuses


def test_the_flight_states_are_those_of_the_message():
    assert all(getattr(FlightStatus, state.name) == state for state in FlightState)
    assert FlightStatus.UNKNOWN == 0


def test_a_number_that_is_no_flight_state_is_ignored(process):
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    process.publish("/in_flight_flight_status", FlightStatus(state=77))
    process.publish("/control/takeoff", control(1.0))
    process.publish("/control/lqr", control(5.0))
    assert thrusts(process) == [1.0, 5.0]
    assert "77 on /in_flight_flight_status" in process.logged("warn")[0]
    assert memory(process) == ["unknown", "flying"]


BOX = {"min": (-1.0, -2.0, 0.9), "max": (1.5, 2.5, 3.0)}


@pytest.mark.parametrize(
    ("position", "is_outside"),
    [
        ((1.9, 2.9, 3.4), False),
        ((-1.4, -2.4, 1.0), False),
        # It is open below: a takeoff begins there.
        ((0.0, 0.0, 0.2), False),
        ((2.1, 0.0, 1.0), True),
        ((0.0, 3.1, 1.0), True),
        ((0.0, 0.0, 3.6), True),
        ((-1.6, 0.0, 1.0), True),
        ((0.0, -2.6, 1.0), True),
    ],
)
def test_motors_stop_half_a_metre_outside_each_wall(position, is_outside):
    status = status_in_box(BOX, position)
    assert (status.state == FilterStatus.EMERGENCY) == is_outside
    assert ("0.60 m outside the geofence" in status.reason) == is_outside


@pytest.mark.parametrize("position", [(99.0, -99.0, 99.0), (-99.0, 99.0, 0.2)])
def test_without_a_corner_there_is_no_wall(position):
    assert status_in_box({}, position).state == FilterStatus.PASSING


def status_in_box(box, position):
    """Return what the filter publishes after a second in flight at a place."""
    process = FakeProcess()
    topics = {"topics/state": "/state", "topics/box": "/geofence/parameter_updates"}
    assert process.launch(TakeoffControlFilterNode(), "/filter", {**FILTER, **topics})
    corners = [
        DoubleParameter(f"box/{corner}/{axis}", value)
        for corner, values in box.items()
        for axis, value in zip("xyz", values, strict=True)
    ]
    process.publish("/geofence/parameter_updates", Config(doubles=corners))
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    state = PositionVelocityYawState(*position, 0.0, 0.0, 0.0, 0.0)
    for _ in range(100):
        process.publish("/state", PositionVelocityYawStateStamped(state=state))
        process.publish("/control/lqr", control(9.81))
        process.advance(0.01)
    return process.published("/in_flight_filter_status")[-1]


def test_whether_there_is_a_controller_is_told_once_a_change():
    process = FakeProcess()
    process.transport.unpublished.add("/control/lqr")
    assert process.launch(TakeoffControlFilterNode(), "/filter", FILTER)
    process.advance(1.0)
    process.transport.unpublished.clear()
    process.advance(1.0)
    told = [each.has_controller for each in process.published("/in_flight_filter_status")]
    assert told == [False, True]


@pytest.mark.parametrize("has_server", [True, False])
def test_a_controller_is_lost_until_another_one_takes_its_place(has_server):
    process = FakeProcess()
    assert process.launch(TakeoffControlFilterNode(), "/filter", FILTER)
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    if not has_server:
        process.transport.unpublished.add("/control/takeoff")
    process.advance(9.0)
    assert process.published("/in_flight_filter_status")[-1].state == FilterStatus.DOWN
    told = process.published("/in_flight_filter_status")
    # Without a server it may have had no reference.
    assert told[-1].has_controller != has_server
    process.transport.unpublished.add("/control/lqr")
    process.advance(0.2)
    assert not told[-1].has_controller
    process.transport.unpublished.clear()
    process.advance(0.2)
    assert told[-1].has_controller


@pytest.mark.parametrize(
    ("has_server", "state", "listens"),
    [
        (True, FlightStatus.UNKNOWN, SERVER_LIMIT),
        (True, FlightStatus.LANDING, LISTENING_TIME),
        (False, FlightStatus.UNKNOWN, LISTENING_TIME),
    ],
)
def test_a_server_that_still_recovers_is_waited_for(has_server, state, listens):
    process = FakeProcess()
    if not has_server:
        process.transport.unpublished.add("/in_flight_flight_status")
    assert process.launch(TakeoffControlFilterNode(), "/filter", FILTER)
    process.publish("/in_flight_flight_status", FlightStatus(state=state))
    while not thrusts(process):
        process.publish("/control/lqr", control(9.0))
        process.advance(0.01)
        assert process.clock.time() < 103.0
    assert process.clock.time() - 100.0 == pytest.approx(listens, abs=0.02)


def test_the_status_in_words_is_published_when_they_change():
    process = launch()
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    for _ in range(120):
        process.publish("/control/lqr", control(9.81))
        process.advance(0.05)
    # The typed one has more to say.
    statuses = process.published("/in_flight_filter_status")
    assert [each.is_commanded for each in statuses if each.has_controller] == [False, True]
    assert memory(process) == ["unknown", "flying"]


def test_levels_of_the_diagnostics(process):
    def level():
        count = len(process.published("/diagnostics"))
        process.advance(1.0)
        return process.published("/diagnostics")[count].status[0].level

    assert level() == flight_topics.OK
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.FLYING))
    assert level() == flight_topics.WARN
    process.advance(1.0)
    assert level() == flight_topics.ERROR
    process.advance(9.0)
    assert process.published("/in_flight_filter_status")[-1].state == FilterStatus.DOWN
    assert level() == flight_topics.ERROR
    # The server knows of it.
    process.publish("/in_flight_flight_status", FlightStatus(state=FlightStatus.ON_GROUND))
    assert level() == flight_topics.OK
    process.call("/emergency", EmptyRequest())
    assert level() == flight_topics.ERROR
