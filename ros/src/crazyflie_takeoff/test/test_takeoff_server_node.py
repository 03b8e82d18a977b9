"""The takeoff server on a fake process."""

import math

import pytest
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.srv import ReconfigureRequest
from std_msgs.msg import Bool, String
from std_srvs.srv import EmptyRequest, EmptyResponse
from takeoff_helpers import BARE, GRAVITY, SERVER, state

from crazyflie_takeoff.takeoff_server_node import (
    RECOVERY_LIMIT,
    START_LIMIT,
    TakeoffServerNode,
)
from crazyflie_utils.runtime.transport import ServiceError
from crazyflie_utils.testing import FakeProcess


def launch(parameters=BARE, **changes):
    """Return a process with a server in it."""
    process = FakeProcess()
    node = TakeoffServerNode()
    assert process.launch(node, "/takeoff_server", {**parameters, **changes})
    process.node = node
    return process


def on_ground(parameters=BARE, **changes):
    """Return a process with a server that knows the vehicle on the ground."""
    process = launch(parameters, **changes)
    if "topics/state" in parameters:
        process.publish("/state", state(0.0))
    process.publish("/in_flight_filter", String("unknown"))
    process.advance(0.02)
    assert states(process) == ["on_ground"]
    return process


def flying(parameters=BARE, **changes):
    """Return a process with a server that knows the vehicle in flight."""
    process = launch(parameters, **changes)
    process.publish("/in_flight_filter", String("flying"))
    if "topics/state" in parameters:
        process.publish("/state", state(1.0))
    process.advance(0.02)
    assert states(process) == ["flying"]
    return process


def call(process, service):
    return process.call(service, EmptyRequest())


def thrusts(process):
    return [message.control.thrust for message in process.published("/control/takeoff")]


def states(process):
    return [message.data for message in process.published("/in_flight_state")]


def toggles(process):
    return len(process.published("/in_flight"))


def test_takes_off_and_lands():
    process = on_ground()
    zeros = len(thrusts(process))
    process.advance(1.0)
    assert thrusts(process) == [0.0] * (zeros + 10)
    future = call(process, "/takeoff")
    process.advance(1.0)
    assert thrusts(process)[zeros + 10 :] == [GRAVITY + 0.2] * 100
    assert not process.published("/ref")
    process.advance(4.99)
    assert not future.done()
    process.advance(0.03)
    assert future.result() == EmptyResponse()
    assert toggles(process) == 1
    (reference,) = process.published("/ref")
    hover = reference.state
    assert (hover.x, hover.y, hover.z) == (0.0, 0.0, 1.0)
    assert (hover.x_dot, hover.y_dot, hover.z_dot) == (0.0, 0.0, 0.0)
    assert reference.header.stamp.to_sec() == pytest.approx(102.03, abs=0.011)

    count = len(thrusts(process))
    process.advance(10.0)
    assert len(thrusts(process)) == count
    future = call(process, "/land")
    process.advance(1.0)
    ramp = thrusts(process)[count:]
    assert ramp == pytest.approx([GRAVITY - 0.05 * k for k in range(100)])
    assert not future.done()
    process.advance(0.02)
    assert future.result() == EmptyResponse()
    assert thrusts(process)[-1] == 0.0
    assert toggles(process) == 2
    assert states(process) == ["on_ground", "taking_off", "flying", "landing", "on_ground"]


def test_controls_are_level_and_stamped():
    process = on_ground()
    call(process, "/takeoff")
    process.advance(0.5)
    message = process.published("/control/takeoff")[-1]
    control = message.control
    assert (control.roll, control.pitch, control.yaw_dot) == (0.0, 0.0, 0.0)
    assert message.header.stamp.to_sec() == pytest.approx(process.clock.time(), abs=0.011)


def test_the_descent_is_straight_down_and_fed_forward():
    process = flying(SERVER)
    future = call(process, "/land")
    height = 1.0
    for _ in range(400):
        process.publish("/state", state(max(height, 0.0)))
        process.advance(0.01)
        height -= 0.003
    assert states(process) == ["flying", "descending", "landing"]
    references = [message.state for message in process.published("/ref")]
    assert len(references) == pytest.approx(317, abs=3)
    steps = [a.z - b.z for a, b in zip(references, references[1:], strict=False)]
    assert steps == pytest.approx([0.003] * len(steps))
    assert {(r.x, r.y, r.x_dot, r.y_dot, r.z_dot) for r in references} == {(0, 0, 0, 0, -0.3)}
    for _ in range(50):
        process.publish("/state", state(0.0))
        process.advance(0.01)
    assert future.result() == EmptyResponse()
    assert thrusts(process)[-1] == 0.0


@pytest.mark.parametrize("bad", [None, math.nan])
def test_a_descent_without_states_ends_in_the_ramp(bad):
    process = flying(SERVER)
    future = call(process, "/land")
    for _ in range(60):
        if bad is not None:
            process.publish("/state", state(bad))
        process.advance(0.01)
    assert states(process) == ["flying", "descending", "landing"]
    assert thrusts(process)[0] == GRAVITY
    process.advance(1.0)
    assert future.done()
    assert len(process.logged("warn")) == (0 if bad is None else 1)


def test_speed_zero_is_the_bare_ramp():
    process = flying(SERVER, **{"landing/descent_speed": 0.0})
    call(process, "/land")
    process.advance(0.01)
    assert thrusts(process) == [GRAVITY]
    assert not process.published("/ref")


def test_refusals_reach_the_caller_and_change_nothing():
    process = on_ground()
    with pytest.raises(ServiceError, match="/land refused: the vehicle is on the ground"):
        call(process, "/land")
    takeoff = call(process, "/takeoff")
    process.advance(0.5)
    with pytest.raises(ServiceError, match="/takeoff refused: a takeoff is under way"):
        call(process, "/takeoff")
    process.advance(5.6)
    assert takeoff.result() == EmptyResponse()
    with pytest.raises(ServiceError, match="/takeoff refused: the vehicle is in flight"):
        call(process, "/takeoff")
    land = call(process, "/land")
    process.advance(0.5)
    for service in ("/takeoff", "/land"):
        with pytest.raises(ServiceError, match=f"{service} refused: a landing is under way"):
            call(process, service)
    process.advance(0.6)
    assert land.result() == EmptyResponse()
    assert toggles(process) == 2
    assert thrusts(process).count(GRAVITY + 0.2) == 100


def test_services_have_other_names_if_wanted():
    process = on_ground(**{"srv/takeoff": "up", "srv/land": "/down"})
    with pytest.raises(ServiceError, match="/down refused"):
        call(process, "/down")
    assert not call(process, "/up").done()


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
    process.publish("/in_flight_filter", String("unknown"))
    process.advance(0.5)
    assert states(process) == []
    process.publish("/state", state(0.1))
    process.advance(0.02)
    assert states(process) == ["on_ground"]
    assert "0.10 m" in process.logged("info")[0]


@pytest.mark.parametrize(("said", "begins"), [("unknown", "on_ground"), ("commanded", "flying")])
def test_a_high_vehicle_is_flying_only_if_a_controller_has_long_been_speaking(said, begins):
    process = launch(SERVER)
    process.publish("/in_flight_filter", String(said))
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


def test_a_word_that_is_no_flight_state_is_ignored():
    process = launch()
    process.publish("/in_flight_filter", String("asleep"))
    process.advance(0.5)
    assert states(process) == []
    assert "asleep" in process.logged("warn")[0]


def test_calls_wait_until_it_is_known_where_the_flight_stands():
    process = launch()
    first, second = call(process, "/takeoff"), call(process, "/takeoff")
    process.advance(0.5)
    assert not first.done()
    assert not second.done()
    process.publish("/in_flight_filter", String("on_ground"))
    process.advance(0.01)
    with pytest.raises(ServiceError, match="a takeoff is under way"):
        second.result(timeout=0)
    process.advance(6.1)
    assert first.result() == EmptyResponse()
    process = launch()
    first = call(process, "/takeoff")
    process.publish("/in_flight_filter", String("flying"))
    process.advance(0.01)
    with pytest.raises(ServiceError, match="in flight"):
        first.result(timeout=0)


def test_what_the_filter_says_later_does_not_matter():
    process = on_ground()
    process.publish("/in_flight_filter", String("flying"))
    process.advance(0.1)
    assert states(process) == ["on_ground"]


def test_a_fault_during_takeoff_tells_the_caller_and_lands():
    process = on_ground()
    future = call(process, "/takeoff")
    process.advance(0.5)
    count = len(thrusts(process))
    process.publish("/in_flight_filter", None)
    with pytest.raises(ServiceError, match="/takeoff_server has failed"):
        future.result(timeout=0)
    assert len(process.logged("error")) == 1
    process.advance(1.05)
    assert states(process)[-2:] == ["landing", "on_ground"]
    assert thrusts(process)[count] == GRAVITY
    assert min(thrusts(process)[count : count + 100]) > 0.0


def test_a_fault_during_landing_tells_the_caller_and_goes_on():
    process = flying()
    future = call(process, "/land")
    process.advance(0.5)
    process.publish("/in_flight_filter", None)
    with pytest.raises(ServiceError):
        future.result(timeout=0)
    process.advance(0.6)
    assert thrusts(process)[:100] == pytest.approx([GRAVITY - 0.05 * k for k in range(100)])
    assert states(process)[-1] == "on_ground"


def test_shutting_down_tells_the_caller_and_sends_nothing():
    for process in (launch(), on_ground()):
        future = call(process, "/takeoff")
        process.advance(0.5)
        count = len(thrusts(process))
        process.node.shutdown()
        assert isinstance(future.exception(timeout=0), ServiceError)
        assert len(thrusts(process)) == count


def test_reset_of_the_clock_in_the_middle_of_a_takeoff():
    process = on_ground()
    future = call(process, "/takeoff")
    process.advance(0.5)
    process.clock.set(1.0)
    process.advance(5.6)
    assert future.result() == EmptyResponse()
    assert thrusts(process).count(GRAVITY + 0.2) == pytest.approx(100, abs=2)


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


def test_takeoff_without_a_controller_is_refused():
    process = on_ground(SERVER)
    for is_there in (True, False):
        process.publish("/in_flight_controller", Bool(is_there))
    with pytest.raises(ServiceError, match="is the controller running"):
        call(process, "/takeoff")
    process.publish("/in_flight_controller", Bool(True))
    assert not call(process, "/takeoff").done()


def started(parameters=SERVER):
    """Return a process with a server that knows the flight state, but has no state yet."""
    process = launch(parameters)
    process.publish("/in_flight_filter", String("on_ground"))
    process.advance(RECOVERY_LIMIT)
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
    process = on_ground(SERVER)
    process.publish("/in_flight_controller", Bool(False))
    call(process, "/takeoff")
    process.publish("/in_flight_controller", Bool(True))
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


def test_landing_needs_neither():
    process = flying(SERVER)
    process.publish("/in_flight_controller", Bool(False))
    process.advance(1.0)
    assert not call(process, "/land").done()


# Changes in flight.


def reconfigure(process, **values):
    """Change parameters as dynamic_reconfigure does."""
    request = ReconfigureRequest(encode_config(values))
    return process.call("/takeoff_server/set_parameters", request)


def test_the_next_takeoff_goes_to_the_new_hover_point():
    process = on_ground(SERVER)
    reconfigure(process, **{"hover/z": 1.5})
    call(process, "/takeoff")
    for _ in range(110):
        process.publish("/state", state(0.0))
        process.advance(0.01)
    assert process.published("/ref")[-1].state.z == 1.5


def test_a_bad_change_is_refused():
    process = on_ground(SERVER)
    with pytest.raises(
        ServiceError, match="/takeoff_server/landing/descent_speed is -1.0; expected"
    ):
        reconfigure(process, **{"landing/descent_speed": -1.0})
