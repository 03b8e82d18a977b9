"""The reply to a command is lost, and the firmware refuses its repetition."""

import threading

import pytest

from crazyflie_link import high_level as module
from crazyflie_link.errors import AlreadyLandingError, NoReplyError, RefusedError
from crazyflie_model.supervisor import SupervisorState

TAKEOFF, LAND = 7, 8
READY = SupervisorState(0x20E)


@pytest.fixture
def flying(vehicle, link):
    """Return the vehicle and its high-level commands; the first reply to each is lost."""
    seen = set()

    def lose(_):
        port, channel, data = vehicle.received[-1]
        is_first = (port, channel) == (8, 0) and data not in seen
        seen.add(data)
        return is_first

    vehicle.lose = lose
    return vehicle, link.high_level


def numbers(vehicle):
    return [data[0] for data in vehicle.packets(8, 0)]


def test_takeoff_and_landing_are_carried_out_once(flying):
    vehicle, high_level = flying
    high_level.take_off(1.0, 2.0)
    assert numbers(vehicle) == [TAKEOFF, TAKEOFF]
    high_level.land(0.0, 2.0)
    assert numbers(vehicle)[2:] == [LAND, LAND]
    assert vehicle.flight.starts == 1


@pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")
def test_before_protocol_12_the_state_cannot_be_read(make_vehicle, make_link):
    vehicle = make_vehicle(protocol=11)
    link = make_link(vehicle.uri)
    link.connect()
    vehicle.lose = lambda _: len(vehicle.packets(8, 0)) == 1
    link.high_level.take_off(1.0, 2.0)
    assert numbers(vehicle) == [TAKEOFF, TAKEOFF]


def test_a_repetition_is_refused_while_the_planner_does_not_fly(flying):
    vehicle, high_level = flying
    vehicle.answers[8, 0, TAKEOFF] = b"\x07\x00\x00\x01"
    vehicle.flight.pin(0x20E)
    with pytest.raises(RefusedError, match="takeoff command"):
        high_level.take_off(1.0, 2.0)


def test_a_refusal_without_a_repetition_is_one(vehicle, link):
    link.high_level.take_off(1.0, 2.0)
    with pytest.raises(RefusedError, match="takeoff command"):
        link.high_level.take_off(1.0, 2.0)
    link.high_level.land(0.0, 2.0)
    with pytest.raises(AlreadyLandingError, match="land command"):
        link.high_level.land(0.0, 2.0)


@pytest.mark.parametrize("number", [TAKEOFF, LAND])
def test_only_a_landing_that_is_refused_as_busy_is_one_already(vehicle, link, number):
    busy, no_memory = b"\1", b"\x0c"
    vehicle.answers[8, 0, number] = bytes([number, 0, 0]) + (no_memory if number == LAND else busy)
    with pytest.raises(RefusedError) as caught:
        (link.high_level.land if number == LAND else link.high_level.take_off)(0.5, 2.0)
    assert type(caught.value) is RefusedError


def test_a_repeated_landing_that_is_refused_is_under_way_whatever_the_state(flying):
    vehicle, high_level = flying
    vehicle.answers[8, 0, LAND] = b"\x08\x00\x00\x01"
    vehicle.flight.pin(0x20E)
    high_level.land(0.0, 2.0)
    assert numbers(vehicle) == [LAND, LAND]


@pytest.mark.parametrize("lag", [0, 1, 3])
def test_the_supervisor_takes_note_of_a_takeoff_a_little_later(monkeypatch, lag):
    states = [READY] * lag + [READY | SupervisorState.HIGH_LEVEL_ACTIVE]
    monkeypatch.setattr(module, "read_state", lambda link: states.pop(0))
    assert module.is_carried_out(None, TAKEOFF)
    assert states == []


@pytest.mark.parametrize("duration", [0.5, 1.0])
def test_a_landing_that_may_have_ended_is_not_repeated(flying, duration):
    """On the ground the firmware obeys, and starts the motors."""
    vehicle, high_level = flying
    with pytest.raises(NoReplyError):
        high_level.land(0.0, duration)
    assert numbers(vehicle) == [LAND]


def test_a_command_whose_time_is_over_is_not_sent_any_more(vehicle, link):
    """The radio may block the thread that sends for 2 s."""
    begun, free = threading.Event(), threading.Event()

    def block():
        begun.set()
        free.wait(60.0)

    link.link().put(block)
    assert begun.wait(60.0)
    with pytest.raises(NoReplyError, match="takeoff command"):
        link.high_level.take_off(1.0, 2.0)
    free.set()
    assert link.supervisor.read() is not None
    assert numbers(vehicle) == []
    assert vehicle.flight.starts == 0


def test_a_relative_way_is_not_repeated(flying):
    vehicle, high_level = flying
    vehicle.flight.pin(0x20E)
    with pytest.raises(NoReplyError, match="it may or may not have been carried out"):
        high_level.go_to((1.0, 0.0, 0.0), 0.0, 2.0, relative=True)
    assert len(numbers(vehicle)) == 1


def test_a_dry_run_refuses_the_same_and_sends_nothing(vehicle, link):
    link.high_level.define_trajectory(3, range(132), 1)
    vehicle.received.clear()
    dry = link.high_level.dry_run()
    dry.take_off(1.0, 2.0)
    dry.start_trajectory(3)
    with pytest.raises(RefusedError, match="4 has not been uploaded"):
        dry.start_trajectory(4)
    dry.define_trajectory(4, range(132), 1)
    with pytest.raises(RefusedError, match="4 has not been uploaded"):
        link.high_level.start_trajectory(4)
    assert vehicle.packets(8, 0) == []


def test_groups_are_known_once_they_are_set(link):
    high_level = link.high_level
    assert high_level.is_addressed(0) is True
    assert high_level.is_addressed(1) is None
    high_level.set_group_mask(5)
    assert [high_level.is_addressed(mask) for mask in (0, 1, 2, 6)] == [True, True, False, True]
    high_level.forget_trajectories()
    assert high_level.is_addressed(1) is False


def test_a_guarded_subsystem_sends_only_what_it_may(vehicle, link):
    allowed = [True]
    high_level = link.high_level.guarded(lambda: allowed[0])
    supervisor = link.supervisor.guarded(lambda: allowed[0])
    high_level.define_trajectory(3, range(132), 1)
    supervisor.arm()
    # Both know the groups and trajectories.
    link.high_level.start_trajectory(3)
    vehicle.received.clear()
    allowed[0] = False
    for send in (high_level.stop, supervisor.arm):
        with pytest.raises(NoReplyError):
            send()
    assert vehicle.packets(8, 0) == vehicle.packets(9, 1) == []
