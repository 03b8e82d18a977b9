"""The takeoff server waits until it knows where the flight stands, and for what it flies with."""

import math

import pytest
from lone_server import call, flying, launch, on_ground, states, thrusts, toggles
from std_msgs.msg import Bool, String
from std_srvs.srv import EmptyResponse
from takeoff_helpers import SERVER, filter_status, state

from crazyflie_msgs.msg import EstimateStatus, FilterStatus, VehicleStatus
from crazyflie_takeoff.takeoff_server_node import RECOVERY_LIMIT, START_LIMIT
from crazyflie_takeoff.vehicle_facts import CONNECTION_TIME, MAX_FACT_AGE
from crazyflie_utils.refusal import ServiceError


def test_says_nothing_until_it_knows_where_the_flight_stands():
    process = launch()
    process.advance(0.99)
    assert thrusts(process) == []
    assert states(process) == []
    process.advance(0.03)
    assert states(process) == ["on_ground"]
    assert thrusts(process) == [0.0]


def test_waits_for_the_height_if_there_is_one():
    process = launch(SERVER)
    process.publish("/in_flight_filter_status", filter_status("unknown"))
    process.advance(0.5)
    assert states(process) == []
    process.publish("/state", state(0.1))
    process.advance(0.02)
    assert states(process) == ["on_ground"]
    assert "0.10 m" in process.logged("info")[0]


@pytest.mark.parametrize(("is_commanded", "begins"), [(False, "on_ground"), (True, "flying")])
def test_a_high_vehicle_is_flying_only_if_a_controller_sends_commands(is_commanded, begins):
    process = launch(SERVER)
    process.publish("/in_flight_filter_status", filter_status(is_commanded=is_commanded))
    process.publish("/state", state(0.7))
    process.advance(0.02)
    assert states(process) == [begins]


def test_flies_if_only_the_height_says_so():
    process = launch(SERVER)
    for _ in range(99):
        process.publish("/state", state(0.5))
        process.advance(0.01)
    assert states(process) == []
    process.publish("/state", state(0.5))
    process.advance(0.02)
    assert states(process) == ["flying"]
    assert thrusts(process) == []
    assert toggles(process) == 0


def test_a_state_that_does_not_exist_is_ignored():
    process = launch()
    process.publish("/in_flight_filter_status", filter_status(state=77))
    process.advance(0.5)
    assert states(process) == []
    assert "ignoring state 77" in process.logged("warn")[-1]


def test_a_takeoff_that_waited_for_the_first_state_is_no_lost_one():
    """It was judged at a time before that state, and ended at once."""
    process = launch(SERVER)
    takeoff = call(process, "/takeoff")
    process.publish("/in_flight_filter_status", filter_status("unknown"))
    process.advance(0.3)
    for _ in range(5):
        process.publish("/state", state(0.0))
        process.advance(0.01)
    assert not takeoff.done()
    assert states(process)[-1] == "taking_off"


def test_calls_wait_until_it_is_known_where_the_flight_stands():
    process = launch()
    first, second = call(process, "/takeoff"), call(process, "/takeoff")
    process.advance(0.5)
    assert not first.done()
    assert not second.done()
    process.publish("/in_flight_filter_status", filter_status("on_ground"))
    process.advance(0.01)
    with pytest.raises(ServiceError, match="a takeoff is under way"):
        second.result(timeout=0)
    process.advance(6.1)
    assert first.result() == EmptyResponse()
    process = launch()
    first = call(process, "/takeoff")
    process.publish("/in_flight_filter_status", filter_status("flying"))
    process.advance(0.01)
    with pytest.raises(ServiceError, match="in flight"):
        first.result(timeout=0)


def test_what_the_filter_says_later_does_not_matter():
    process = on_ground()
    process.publish("/in_flight_filter_status", filter_status("flying"))
    process.advance(0.1)
    assert states(process) == ["on_ground"]


# Nothing to fly with.


def test_takeoff_without_a_fresh_state_is_refused():
    process = on_ground(SERVER)
    process.advance(0.6)
    with pytest.raises(
        ServiceError, match="/takeoff refused: no state has come on /state for 0.5 s"
    ):
        call(process, "/takeoff")
    process.advance(1.0)
    assert (states(process), max(thrusts(process))) == (["on_ground"], 0.0)
    process.publish("/state", state(0.0))
    assert not call(process, "/takeoff").done()


def test_takeoff_without_a_state_that_is_finite_is_refused():
    process = on_ground(SERVER)
    process.advance(0.6)
    process.publish("/state", state(math.nan))
    with pytest.raises(ServiceError, match="no state has come"):
        call(process, "/takeoff")


def test_takeoff_with_states_that_are_old_when_they_come_is_refused():
    process = on_ground(SERVER)
    process.advance(0.6)
    for age in (0.6, 2.0, 99.0):
        now = process.clock.time()
        process.publish("/state", state(0.0, stamp=process.clock.stamp(now - age)))
        with pytest.raises(ServiceError, match=f"states on /state are {age:.1f} s old when they"):
            call(process, "/takeoff")


@pytest.mark.parametrize("ahead", [None, 0.0, 1000.0])
def test_a_stamp_that_is_missing_or_ahead_says_nothing_about_age(ahead):
    process = on_ground(SERVER)
    process.advance(0.6)
    now = process.clock.time()
    stamp = None if ahead is None else process.clock.stamp(now + ahead)
    process.publish("/state", state(0.0, stamp=stamp))
    assert not call(process, "/takeoff").done()


@pytest.mark.parametrize("height", [0.96, 1.5])
def test_takeoff_to_a_hover_point_that_is_not_above_the_vehicle_is_refused(height):
    """The vehicle was pressed to its table, and was said to be unable to fly."""
    process = on_ground(SERVER)
    process.publish("/state", state(height))
    words = rf"hover/z is 1 m, and the vehicle is at {height:.2f} m; expected a point above it"
    with pytest.raises(ServiceError, match=words):
        call(process, "/takeoff")


def test_takeoff_of_a_vehicle_that_has_tilted_over_is_refused():
    """The filter ended it with an emergency, which had to be reset."""
    process = on_ground(SERVER)
    for is_tilted in (True, False):
        process.publish("/state_status", EstimateStatus(is_tilted=is_tilted))
        if is_tilted:
            with pytest.raises(ServiceError, match="the vehicle has tilted over"):
                call(process, "/takeoff")
    assert not call(process, "/takeoff").done()


def publish_controller(process, has_controller, flight="on_ground"):
    process.publish(
        "/in_flight_filter_status", filter_status(flight, has_controller=has_controller)
    )


def test_takeoff_without_a_controller_is_refused():
    process = on_ground(SERVER)
    for is_there in (True, False):
        publish_controller(process, is_there)
    with pytest.raises(ServiceError, match="is the controller running"):
        call(process, "/takeoff")
    publish_controller(process, True)
    assert not call(process, "/takeoff").done()


def started(parameters=SERVER):
    """Return a process with a server that knows the flight state, but has no state yet."""
    process = launch(parameters)
    process.publish("/in_flight_filter_status", filter_status("on_ground"))
    # It is published at the next tick.
    process.advance(RECOVERY_LIMIT + 0.01)
    assert states(process) == ["on_ground"]
    return process


def test_takeoff_waits_for_the_first_state():
    process = started()
    answer = call(process, "/takeoff")
    process.advance(2.0)
    assert states(process) == ["on_ground"]
    process.publish("/state", state(0.0))
    process.advance(0.02)
    assert (states(process)[-1], answer.done()) == ("taking_off", False)


def test_takeoff_waits_for_a_controller():
    process = launch(SERVER)
    publish_controller(process, False)
    process.advance(RECOVERY_LIMIT + 0.01)
    call(process, "/takeoff")
    publish_controller(process, True)
    process.publish("/state", state(0.0))
    process.advance(0.02)
    assert states(process)[-1] == "taking_off"


def test_takeoff_does_not_wait_for_ever():
    process = started()
    answer = call(process, "/takeoff")
    process.advance(START_LIMIT)
    with pytest.raises(ServiceError, match="no state has come on /state"):
        answer.result(0)
    with pytest.raises(ServiceError, match="no state has come on /state"):
        call(process, "/takeoff")


def test_a_landing_ends_a_takeoff_that_waits():
    """The vehicle is to stay where it is; it took off later."""
    process = started()
    answer = call(process, "/takeoff")
    with pytest.raises(ServiceError, match="the vehicle is on the ground"):
        call(process, "/land")
    with pytest.raises(ServiceError, match="takeoff aborted: /land was called"):
        answer.result(0)
    process.publish("/state", state(0.0))
    process.advance(0.1)
    assert states(process) == ["on_ground"]


def test_an_emergency_ends_a_takeoff_that_waits():
    """It took off after the reset."""
    process = started()
    answer = call(process, "/takeoff")
    emergency = filter_status("on_ground", FilterStatus.EMERGENCY, reason="it was called")
    process.publish("/in_flight_filter_status", emergency)
    process.advance(0.1)
    with pytest.raises(ServiceError, match="emergency, it was called; reset it first"):
        answer.result(0)


def test_landing_needs_neither():
    process = flying(SERVER)
    publish_controller(process, False, "flying")
    process.advance(1.0)
    assert not call(process, "/land").done()


DRIVEN = {**SERVER, "topics/connected": "/cf1/connected"}
NOT_CONNECTED = "the driver is not connected to the vehicle, {} on /cf1/connected; .*prefix:=cf1"


def test_takeoff_waits_for_the_driver():
    process = on_ground(DRIVEN)
    answer = call(process, "/takeoff")
    process.publish("/cf1/connected", Bool(False))
    process.advance(2.0)
    assert (states(process), answer.done()) == (["on_ground"], False)
    process.publish("/cf1/connected", Bool(True))
    process.publish("/state", state(0.0))
    process.advance(CONNECTION_TIME - 0.02)
    process.publish("/state", state(0.0))
    process.advance(0.05)
    assert states(process)[-1] == "taking_off"


@pytest.mark.parametrize(("said", "words"), [([], "nothing"), ([True, False], "false")])
def test_takeoff_without_the_driver_is_refused(said, words):
    process = on_ground(DRIVEN)
    process.advance(START_LIMIT)
    for value in said:
        process.publish("/cf1/connected", Bool(value))
    process.publish("/state", state(0.0))
    with pytest.raises(ServiceError, match=NOT_CONNECTED.format(words)):
        call(process, "/takeoff")
    process.advance(0.2)
    assert "the driver is not connected" in process.published("/in_flight_status")[-1].data


def test_a_driver_that_has_died_is_not_connected():
    process = on_ground(DRIVEN)
    process.advance(START_LIMIT)
    process.publish("/cf1/connected", Bool(True))
    process.advance(MAX_FACT_AGE + 0.1)
    process.publish("/state", state(0.0))
    with pytest.raises(ServiceError, match=NOT_CONNECTED.format("nothing")):
        call(process, "/takeoff")


@pytest.mark.parametrize(
    ("status", "reason"),
    [
        ({"supervisor": VehicleStatus.LOCKED}, "its state is: locked; restart the vehicle"),
        ({"supervisor": 1 << 11}, "its state is: deck fault; .* see that its decks sit right"),
        ({"supervisor": VehicleStatus.CRASHED}, "state is: crashed"),
        ({"is_emergency": True}, "stopped by emergency; remove it, restart it"),
        ({"has_supervisor": True}, "/takeoff refused: the vehicle is not armed; call /cf1/arm"),
        (
            {"has_supervisor": True, "supervisor": VehicleStatus.ARMED},
            "the vehicle cannot fly yet, its state is: armed",
        ),
        (
            {"has_supervisor": True, "supervisor": VehicleStatus.AUTO_ARMED},
            "the vehicle cannot fly yet, its state is: auto armed",
        ),
    ],
)
def test_takeoff_of_a_vehicle_that_cannot_fly_is_refused_at_once(status, reason):
    process = on_ground(DRIVEN)
    process.publish("/cf1/connected", Bool(True))
    process.publish("/cf1/vehicle_status", VehicleStatus(**status))
    process.publish("/state", state(0.0))
    with pytest.raises(ServiceError, match=reason):
        call(process, "/takeoff")
    process.advance(CONNECTION_TIME)
    process.publish("/state", state(0.0))
    process.publish("/cf1/vehicle_status", VehicleStatus(supervisor=VehicleStatus.CAN_FLY))
    call(process, "/takeoff")
    process.advance(0.02)
    assert states(process)[-1] == "taking_off"


@pytest.mark.parametrize(
    ("status", "reason"),
    [
        ({"takeoff_refusal": "two nodes publish"}, "/takeoff refused: two nodes publish"),
        (
            {"state": FilterStatus.EMERGENCY, "reason": "it was called"},
            "/takeoff refused: emergency, it was called; reset it first",
        ),
    ],
)
def test_takeoff_that_the_filter_would_not_pass_on_is_refused(status, reason):
    process = on_ground()
    process.publish("/in_flight_filter_status", filter_status("on_ground", **status))
    with pytest.raises(ServiceError, match=reason):
        call(process, "/takeoff")


def test_a_driver_is_asked_for_only_if_there_is_one():
    process = on_ground(SERVER)
    process.publish("/state", state(0.0))
    call(process, "/takeoff")
    process.advance(0.02)
    assert states(process)[-1] == "taking_off"


# Another node.


def test_takeoff_waits_for_what_the_node_says_that_may_inhibit_it():
    process = on_ground(**{"topics/inhibition": "/inhibition"})
    with pytest.raises(ServiceError, match="/takeoff refused: nothing has come on /inhibition"):
        call(process, "/takeoff")
    process.publish("/inhibition", String("cf2 stands too close"))
    with pytest.raises(ServiceError, match="/takeoff refused: cf2 stands too close"):
        call(process, "/takeoff")
    process.publish("/inhibition", String(""))
    assert not call(process, "/takeoff").done()


# The filter ends a flight.


@pytest.mark.parametrize("does", [FilterStatus.SINKING, FilterStatus.EMERGENCY])
def test_a_takeoff_that_the_filter_ends_is_an_error(does):
    process = on_ground()
    takeoff = call(process, "/takeoff")
    process.advance(0.5)
    process.publish("/in_flight_filter_status", filter_status("taking_off", does, reason="lost"))
    with pytest.raises(ServiceError, match="the flight was ended by the filter: lost"):
        takeoff.result(0)


def test_a_landing_that_the_filter_finishes_has_succeeded_but_not_one_that_it_stops():
    process = flying()
    land = call(process, "/land")
    process.advance(0.5)
    report = filter_status("landing", FilterStatus.SINKING, reason="lost")
    process.publish("/in_flight_filter_status", report)
    process.advance(0.5)
    assert not land.done()
    report = filter_status("landing", FilterStatus.DOWN, reason="lost")
    process.publish("/in_flight_filter_status", report)
    process.advance(0.02)
    assert land.result(0) == EmptyResponse()

    process = flying()
    land = call(process, "/land")
    process.advance(0.5)
    report = filter_status("landing", FilterStatus.EMERGENCY, reason="it was called")
    process.publish("/in_flight_filter_status", report)
    with pytest.raises(ServiceError, match="the flight was ended by the filter: it was called"):
        land.result(0)


@pytest.mark.parametrize("is_armed_again", [True, False])
def test_a_takeoff_waits_for_a_vehicle_that_arms_itself_again(is_armed_again):
    """It is not armed for 0.2 s after a landing, and every 30 s on the ground."""
    process = on_ground(DRIVEN)
    auto, ready = VehicleStatus.AUTO_ARMED, VehicleStatus.ARMED | VehicleStatus.CAN_FLY

    def publish(state_of_vehicle):
        status = VehicleStatus(supervisor=state_of_vehicle, has_supervisor=True)
        process.publish("/cf1/vehicle_status", status)

    publish(auto | ready)
    publish(auto)
    process.publish("/cf1/connected", Bool(True))
    process.publish("/state", state(0.0))
    takeoff = call(process, "/takeoff")
    process.advance(0.2)
    assert not takeoff.done()
    assert states(process)[-1] == "on_ground"
    process.publish("/state", state(0.0))
    if is_armed_again:
        publish(auto | ready)
    process.advance(0.32)
    assert states(process)[-1] == ("taking_off" if is_armed_again else "on_ground")
    if not is_armed_again:
        with pytest.raises(ServiceError, match="the vehicle cannot fly yet"):
            takeoff.result(0)


def test_a_takeoff_waits_for_zero_thrust_to_reach_a_new_driver():
    """Before it, the driver passes no thrust."""
    process = on_ground(DRIVEN)
    process.publish("/cf1/connected", Bool(True))
    process.publish("/state", state(0.0))
    call(process, "/takeoff")
    process.advance(CONNECTION_TIME - 0.02)
    assert states(process)[-1] == "on_ground"
    assert set(thrusts(process)) == {0.0}
    process.publish("/state", state(0.0))
    process.advance(0.05)
    assert states(process)[-1] == "taking_off"
