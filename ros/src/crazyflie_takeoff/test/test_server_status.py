"""Status and log of the takeoff server on a fake process."""

import pytest
from lone_server import call, flying, launch, on_ground, states
from takeoff_helpers import SERVER, filter_status, state

from crazyflie_msgs.msg import FilterStatus, FlightStatus
from crazyflie_takeoff import flight_topics

FILTER_STATUS = "/in_flight_filter_status"


def statuses(process):
    return process.published("/in_flight_flight_status")


def logged(process):
    """Return the log, without the name of the node."""
    return [text.partition(": ")[2] for text in process.logged("info")]


def diagnosis(process):
    """Return level and figures of the next diagnostics."""
    count = len(process.published("/diagnostics"))
    process.advance(flight_topics.DIAGNOSTICS_PERIOD)
    (status,) = process.published("/diagnostics")[count].status
    return status.level, {each.key: each.value for each in status.values}


def test_the_status_is_published_when_it_changes_and_not_before_it_is_known():
    process = launch()
    process.advance(0.9)
    assert statuses(process) == []
    process.publish(FILTER_STATUS, filter_status())
    process.advance(2.0)
    (status,) = statuses(process)
    assert (status.state, status.takeoff_refusal) == (FlightStatus.ON_GROUND, "")
    process.publish(FILTER_STATUS, filter_status(has_controller=False))
    process.advance(2.0)
    (refused,) = statuses(process)[1:]
    assert refused.takeoff_refusal.startswith("no commanded controls come")


@pytest.mark.parametrize(
    ("remembered", "report", "reason"),
    [
        (
            "flying",
            {"state": FilterStatus.HOLDING, "reason": "no control comes"},
            "no control comes",
        ),
        ("flying", {"state": FilterStatus.PASSING, "reason": "no control comes"}, ""),
        ("on_ground", {"state": FilterStatus.HOLDING, "reason": "no control comes"}, ""),
    ],
)
def test_that_the_filter_holds_the_vehicle_is_a_reason_in_flight(remembered, report, reason):
    process = flying() if remembered == "flying" else on_ground()
    process.publish(FILTER_STATUS, filter_status(remembered, **report))
    process.advance(0.2)
    assert statuses(process)[-1].reason == reason


def test_a_landing_is_logged_once_with_its_reason():
    process = flying(SERVER)
    process.node.prepare_shutdown()
    for _ in range(50):
        process.publish("/state", state(1.0))
        process.advance(0.01)
    for _ in range(400):
        process.publish("/state", state(0.0))
        process.advance(0.01)
    assert states(process) == ["flying", "descending", "landing", "on_ground"]
    assert logged(process)[1:] == ["landing: the launch is to end", "on the ground"]


def test_what_the_filter_has_logged_is_not_logged_again():
    process = flying()
    stopped = filter_status("flying", FilterStatus.EMERGENCY, reason="/emergency was called")
    process.publish(FILTER_STATUS, stopped)
    process.advance(0.2)
    assert logged(process)[1:] == ["on the ground"]
    assert statuses(process)[-1].reason == "/emergency was called"


def test_the_height_in_the_log_is_that_above_the_ground_of_the_flight():
    process = launch(SERVER, ground=0.5)
    process.publish(FILTER_STATUS, filter_status("landing"))
    process.publish("/state", state(1.25))
    process.advance(0.02)
    assert logged(process) == ["begins descending: landing is remembered, the height is 0.75 m"]


def test_a_process_in_flight_does_not_end_before_the_landing():
    process = flying()
    assert process.published("/flights")[-1].data == "/takeoff_server in flight"
    call(process, "/land")
    process.advance(1.2)
    assert process.published("/flights")[-1].data == "/takeoff_server on ground"


def test_levels_of_the_diagnostics():
    process = on_ground(SERVER)
    process.publish("/state", state(0.0))
    process.advance(0.3)
    level, figures = diagnosis(process)
    assert level == flight_topics.WARN
    assert figures["state is fresh"] == "False"

    process = on_ground()
    assert diagnosis(process)[0] == flight_topics.OK
    process.publish(FILTER_STATUS, filter_status("on_ground", FilterStatus.EMERGENCY))
    assert diagnosis(process)[0] == flight_topics.ERROR
    process = flying()
    assert diagnosis(process)[0] == flight_topics.OK
    process.publish(FILTER_STATUS, filter_status("flying", FilterStatus.SINKING, reason="lost"))
    assert diagnosis(process)[0] == flight_topics.ERROR


def test_whether_the_state_is_fresh_is_a_figure():
    process = on_ground(SERVER)
    count = len(process.published("/diagnostics"))
    while len(process.published("/diagnostics")) == count:
        process.publish("/state", state(0.0))
        process.advance(0.01)
    (status,) = process.published("/diagnostics")[-1].status
    assert status.level == flight_topics.OK
    assert {each.key: each.value for each in status.values}["state is fresh"] == "True"
