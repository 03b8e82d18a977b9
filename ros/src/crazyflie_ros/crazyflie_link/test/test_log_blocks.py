"""Log blocks that the vehicle refuses, at first or when it is connected again."""

import errno
import queue

import pytest

from crazyflie_link.crazyflie import LinkState
from crazyflie_link.errors import NoReplyError, RefusedError, ValueRangeError
from crazyflie_link.log import LogBlock

LIMIT = 60.0
DELETE, START, CREATE, APPEND = 2, 3, 6, 7

#: Ten variables with the 26 bytes of a packet: one packet creates the block with nine of them, a
#: second one appends the last.
TEN = {
    **{f"ten.{name}": ("f", 1.5) for name in "abcde"},
    **{f"ten.{name}": ("B", 7) for name in "fghi"},
    "ten.j": ("h", -300),
}


def log_block(name, receive=lambda *_: None, variables=("pm.vbat",), period_ms=20):
    return LogBlock(name, period_ms, variables, receive)


def test_a_start_that_the_vehicle_refuses_is_an_error(vehicle, make_link, states):
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    vehicle.answers[5, 1, 3] = b"\3\1\2"
    with pytest.raises(RefusedError, match="'refused': the vehicle answers: No such block id"):
        link.add_log_block(log_block("refused"))
    # Its data are not missed.
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + 10)
    assert (link.state, link.connection_count) == (LinkState.CONNECTED, 1)


def test_an_unknown_error_code_is_a_refusal(vehicle, link):
    vehicle.answers[5, 1, 3] = b"\3\1\x63"
    with pytest.raises(RefusedError, match="'odd': the vehicle answers: error 99"):
        link.add_log_block(log_block("odd"))


def test_a_block_that_is_refused_later_does_not_end_connecting(vehicle, make_link, states):
    """Firmware without one of its variables may have been installed meanwhile."""
    received = queue.Queue()
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    link.add_log_block(log_block("gone", variables=("pm.state",)))
    link.add_log_block(log_block("kept", lambda *data: received.put(data)))
    vehicle.is_frozen = True
    states.wait_for(LinkState.LOST)
    del vehicle.log["pm.state"]
    vehicle.forget_logs()
    vehicle.is_frozen = False
    text = states.wait_for(LinkState.CONNECTED)
    assert "again, without log block 'gone'" in text
    assert "no log variable 'pm.state'" in text
    while not received.empty():
        received.get()
    assert received.get(timeout=LIMIT)[1] == (3.75,)


@pytest.mark.parametrize("period_ms", [15, 99, 2539])
def test_periods_between_the_steps_are_not_cut(link, period_ms):
    with pytest.raises(
        ValueRangeError, match=f"{period_ms} ms; expected 10 to 2540 ms, in steps of 10"
    ):
        link.add_log_block(log_block("odd", period_ms=period_ms))


class Losses:
    """A vehicle that loses the first packet with each of some commands, or its answer."""

    def __init__(self, vehicle, requests, answers):
        self._vehicle, self._requests, self._answers = vehicle, list(requests), list(answers)
        self._handle, vehicle._reply = vehicle._reply, self._reply
        vehicle.lose = lambda _: self._is_lost(self._answers, *vehicle.received[-1])

    def _reply(self, *packet):
        if not self._is_lost(self._requests, *packet):
            self._handle(*packet)

    def _is_lost(self, commands, port, channel, data):
        is_lost = (port, channel) == (5, 1) and data[0] in commands
        if is_lost:
            commands.remove(data[0])
        return is_lost


@pytest.mark.parametrize(
    ("requests", "answers"),
    [
        ([], []),
        ([CREATE], []),
        ([APPEND], []),
        ([START], []),
        ([], [CREATE]),
        ([], [APPEND]),
        ([], [START]),
        ([], [APPEND, START]),
        ([CREATE, APPEND], []),
        ([], [CREATE, APPEND]),
        ([CREATE, APPEND, START], [CREATE, APPEND, START]),
    ],
)
def test_a_block_of_two_packets_is_complete_whatever_is_lost(
    make_vehicle, make_link, requests, answers
):
    vehicle = make_vehicle(log=TEN)
    link = make_link(vehicle.uri)
    link.connect()
    Losses(vehicle, requests, answers)
    received = queue.Queue()
    link.add_log_block(log_block("ten", lambda *data: received.put(data), tuple(TEN)))
    assert received.get(timeout=LIMIT)[1] == tuple(value for _, value in TEN.values())


@pytest.mark.parametrize(
    ("command", "code", "text"),
    [
        (CREATE, errno.ENOMEM, "No more memory available"),
        (CREATE, errno.E2BIG, "Block too large"),
        (APPEND, errno.ENOMEM, "No more memory available"),
        (APPEND, errno.EEXIST, "Block already exists"),
        (START, errno.EEXIST, "Block already exists"),
    ],
)
def test_a_block_of_which_a_part_is_refused_is_refused(
    make_vehicle, make_link, command, code, text
):
    vehicle = make_vehicle(log=TEN)
    link = make_link(vehicle.uri)
    link.connect()
    vehicle.answers[5, 1, command] = bytes([command, 1, code])
    with pytest.raises(RefusedError, match=f"'ten': the vehicle answers: {text}"):
        link.add_log_block(log_block("ten", variables=tuple(TEN)))


@pytest.mark.parametrize("lost", [1, 2])
def test_no_variables_are_mixed_up_when_an_answer_is_lost(make_vehicle, make_link, lost):
    """A block of three packets: a second one that comes twice would displace the third.

    It is not known whether it has come: the block is deleted and begun again.
    """
    variables = {f"many.n{number:02}": ("B", number) for number in range(26)}
    vehicle = make_vehicle(log=variables)
    link = make_link(vehicle.uri)
    link.connect()
    received, appended = queue.Queue(), []

    def lose(_):
        port, channel, data = vehicle.received[-1]
        if (port, channel, data[0]) == (5, 1, APPEND):
            appended.append(data)
        return data in appended and len(appended) == lost

    vehicle.lose = lose
    block = log_block("many", lambda *data: received.put(data), tuple(variables))
    link.add_log_block(block)
    assert received.get(timeout=LIMIT)[1] == tuple(range(26))
    assert [data[0] for data in vehicle.packets(5, 1)].count(DELETE) == (lost == 1)


@pytest.mark.parametrize("is_lost", [True, False])
def test_a_block_that_cannot_be_started_leaves_nothing_behind(make_vehicle, make_link, is_lost):
    """Its second packet has no answer, however often it is tried; or it is refused."""
    variables = {f"many.n{number:02}": ("B", number) for number in range(26)}
    vehicle = make_vehicle(log=variables)
    link = make_link(vehicle.uri)
    link.connect()
    if is_lost:
        vehicle.lose = lambda _: vehicle.received[-1][2][:1] == bytes([APPEND])
    else:
        vehicle.answers[5, 1, APPEND] = bytes([APPEND, 1, errno.ENOMEM])
    with pytest.raises(NoReplyError if is_lost else RefusedError, match="'many'"):
        link.add_log_block(log_block("many", variables=tuple(variables)))
    assert vehicle._logs._blocks == {}
