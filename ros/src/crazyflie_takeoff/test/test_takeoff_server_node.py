"""The takeoff server on a fake process."""

import math

import pytest
from lone_server import call, flying, launch, on_ground, states, thrusts, toggles
from std_srvs.srv import EmptyResponse
from takeoff_helpers import GRAVITY, SERVER, state

from crazyflie_utils.refusal import ServiceError


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
def test_a_descent_without_states_goes_on_for_as_long_as_it_takes(bad):
    process = flying(SERVER)
    future = call(process, "/land")

    def advance(duration):
        for _ in range(round(duration * 100)):
            if bad is not None:
                process.publish("/state", state(bad))
            process.advance(0.01)

    advance(6.2)
    assert states(process) == ["flying", "descending"]
    assert thrusts(process) == []
    assert len(process.published("/ref")) == pytest.approx(620, abs=2)
    advance(0.2)
    assert states(process) == ["flying", "descending", "landing"]
    assert thrusts(process)[0] == GRAVITY
    advance(1.0)
    assert future.done()
    # As often as the machine's clock permits, which is not that of the flight.
    text = "/takeoff_server: ignoring a message on /state: its state is not finite"
    assert {*process.logged("warn")} == ({text} if bad else set())


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


def test_a_fault_during_takeoff_tells_the_caller_and_lands():
    process = on_ground()
    future = call(process, "/takeoff")
    process.advance(0.5)
    count = len(thrusts(process))
    process.publish("/in_flight_filter_status", None)
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
    process.publish("/in_flight_filter_status", None)
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


# Changes in flight.


def test_the_next_takeoff_goes_to_the_new_hover_point():
    process = on_ground(SERVER)
    process.reconfigure("/takeoff_server", **{"hover/z": 1.5})
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
        process.reconfigure("/takeoff_server", **{"landing/descent_speed": -1.0})
