"""Connections that succeed, fail or get stuck, and what goes over them."""

import queue
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import MagicMock

import pytest

from crazyflie_link.crazyflie import LinkState
from crazyflie_link.errors import (
    CrazyflieError,
    LinkLostError,
    NoAnswerError,
    NoReplyError,
    RefusedError,
    SetupError,
    UnknownNameError,
    ValueRangeError,
)
from crazyflie_link.link import LinkTimeouts
from crazyflie_link.log import LogBlock

LIMIT = 60.0
QUICK = LinkTimeouts(first_answer=0.4)


def test_all_tables_are_there_once_connected(link):
    assert link.state is LinkState.CONNECTED
    assert link.log.variables()["stateEstimateZ.quat"] == "uint32_t"
    assert link.log.variables()["kalman.q0"] == "FP16"
    assert len(link.parameters.values()) == 5


def test_tables_are_read_once_and_then_cached(make_vehicle, make_link):
    first, second = make_vehicle(), make_vehicle()
    for vehicle in (first, second):
        make_link(vehicle.uri).connect()
    items = [len([d for d in v.packets(5, 0) if d[0] == 2]) for v in (first, second)]
    assert items == [len(first.log), 0]


def test_other_firmware_has_other_tables(make_vehicle, make_link):
    make_link(make_vehicle().uri).connect()
    other = make_vehicle(log={"motor.m1": ("H", 0)})
    link = make_link(other.uri)
    link.connect()
    assert list(link.log.variables()) == ["motor.m1"]


def test_a_vehicle_without_parameters_connects(make_vehicle, make_link):
    link = make_link(make_vehicle(parameters={}).uri)
    link.connect()
    assert link.parameters.values() == {}


def test_every_eighth_reply_may_be_lost(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.lose = lambda count: count % 8 == 1
    link = make_link(vehicle.uri)
    link.connect()
    assert link.parameters.write("ring.effect", 9) == 9
    link.high_level.land(0.0, 1.0)


def test_no_vehicle_there(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.close()
    with pytest.raises(NoAnswerError, match=f"{vehicle.uri}: nothing listens on this port"):
        make_link(vehicle.uri, limits=QUICK).connect()


def test_the_port_is_open_but_silent(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.is_frozen = True
    link = make_link(vehicle.uri, limits=QUICK)
    with pytest.raises(NoAnswerError, match="no answer has come within 0.4 s"):
        link.connect()
    assert link.state is LinkState.DISCONNECTED


STUCK = [
    ((13, 1, b""), "waiting for the first answer"),
    ((5, 1, b"\x05"), "waiting for the first answer"),
    ((5, 0, b"\x03"), "waiting for the first answer"),
    ((5, 0, b"\x02\x03\x00"), "log table, item 3 of 8"),
    ((4, 0, b"\x01"), "log table, item 8 of 8"),
    ((4, 0, b"\x02\x01"), "list of memories"),
    ((2, 0, b"\x02\x01\x00"), "parameter table, item 1 of 5"),
    ((2, 3, b""), "parameter table, item 5 of 5"),
    ((2, 1, b"\x02\x00"), "parameter values, 2 of 5"),
]


def test_a_set_up_that_is_stuck_says_where(make_vehicle, make_link):
    def connect(case):
        deaf, _ = case
        vehicle = make_vehicle()
        vehicle.deaf.add(deaf)
        with pytest.raises(SetupError) as caught:
            make_link(vehicle.uri, limits=LinkTimeouts(stall=1.0)).connect()
        return str(caught.value)

    with ThreadPoolExecutor(len(STUCK)) as pool:
        for (_, step), text in zip(STUCK, pool.map(connect, STUCK), strict=True):
            assert f"the connection is stuck ({step}) for 1 s" in text


def test_a_set_up_that_takes_too_long(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.lose = lambda count: count % 2 == 0
    limits = LinkTimeouts(stall=5.0, total=1.0)
    with pytest.raises(SetupError, match="not connected after 1 s"):
        make_link(vehicle.uri, limits=limits).connect()


def test_firmware_that_is_too_old(make_vehicle, make_link):
    vehicle = make_vehicle(protocol=3)
    with pytest.raises(SetupError, match="the firmware speaks protocol 3, at least 4 is needed"):
        make_link(vehicle.uri).connect()


def test_a_stuck_vehicle_stops_no_other(make_vehicle, make_link):
    stuck = make_vehicle()
    stuck.deaf.add((4, 0, b""))
    good = [make_vehicle() for _ in range(4)]
    with ThreadPoolExecutor() as pool:
        stuck_link = make_link(stuck.uri, limits=LinkTimeouts(stall=LIMIT))
        connecting_stuck = pool.submit(stuck_link.connect)
        links = [make_link(vehicle.uri) for vehicle in good]
        for connecting in [pool.submit(link.connect) for link in links]:
            connecting.result(timeout=LIMIT)
        assert not connecting_stuck.done()
        stuck_link.close()
        assert isinstance(connecting_stuck.exception(timeout=LIMIT), LinkLostError)


def test_closing_while_connecting(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.deaf.add((4, 0, b""))
    link = make_link(vehicle.uri, limits=LinkTimeouts(stall=LIMIT))
    with ThreadPoolExecutor() as pool:
        connecting = pool.submit(link.connect)
        vehicle.wait_for_packets(4, 0)
        link.close()
        assert isinstance(connecting.exception(timeout=LIMIT), LinkLostError)


def test_log_blocks_of_all_types(vehicle, link):
    received = queue.Queue()
    variables = tuple(v for v in vehicle.log if v != "stateEstimate.y")
    link.add_log_block(LogBlock("all", 10, variables, lambda *data: received.put(data)))
    time_ms, values = received.get(timeout=LIMIT)
    assert values == (1.5, 3.75, 47, -1, 0xC0000000, -1234, 0.5)
    assert 0 <= time_ms < 1 << 24


@pytest.mark.parametrize(
    ("period", "variables", "error", "text"),
    [
        (5, ("pm.vbat",), ValueRangeError, "expected 10 to 2540 ms"),
        (3000, ("pm.vbat",), ValueRangeError, "expected 10 to 2540 ms"),
        (10, (), ValueRangeError, "no variables"),
        (10, ("pm.vbat",) * 7, ValueRangeError, "28 bytes; at most 26"),
        (10, ("pm.vbatt",), UnknownNameError, "did you mean pm.vbat"),
    ],
)
def test_impossible_log_blocks(link, period, variables, error, text):
    with pytest.raises(error, match=text):
        link.add_log_block(LogBlock("bad", period, variables, lambda *_: None))


def test_a_log_block_that_the_vehicle_refuses(vehicle, link):
    vehicle.answers[5, 1, 6] = b"\x06\x01\x0c"
    with pytest.raises(RefusedError, match="'big': the vehicle answers: No more memory"):
        link.add_log_block(LogBlock("big", 10, ("pm.vbat",), lambda *_: None))


def test_a_log_block_without_reply(vehicle, link):
    vehicle.deaf.add((5, 1, b"\x06"))
    with pytest.raises(NoReplyError, match="'lost'"):
        link.add_log_block(LogBlock("lost", 10, ("pm.vbat",), lambda *_: None))


def test_too_many_log_blocks(link):
    blocks = [LogBlock(f"b{k}", 1000, ("pm.state",), lambda *_: None) for k in range(17)]
    with pytest.raises(RefusedError, match="b16.*16"):
        for block in blocks:
            link.add_log_block(block)


def test_console_lines(vehicle, make_link):
    lines = queue.Queue()
    link = make_link(vehicle.uri, on_console=lines.put)
    link.connect()
    text = "SYS: ----\nEST: Größe\r\n"
    data = text.encode()
    for k in range(0, len(data), 5):
        vehicle.send(0, 0, data[k : k + 5])
    assert [lines.get(timeout=LIMIT) for _ in range(2)] == ["SYS: ----", "EST: Größe"]


def test_all_packets_can_be_received_and_a_bad_callback_ends_nothing(vehicle, make_link, caplog):
    received = queue.Queue()

    def on_packet(*packet):
        received.put(packet)
        raise RuntimeError("a bad callback")

    link = make_link(vehicle.uri, on_packet=on_packet)
    link.connect()
    vehicle.send(13, 2, b"app")
    while received.get(timeout=LIMIT) != (13, 2, b"app"):
        pass
    assert link.parameters.read("ring.effect") == 6
    assert "a packet could not be handled" in caplog.text
    assert "a bad callback" in caplog.text


def test_link_figures(vehicle, link):
    vehicle.wait_for_packets(15, 0, 5)
    assert 0.0 < link.latency() < 1.0
    assert link.quality() > 0.5
    assert 0.0 <= link.age() < 0.5
    assert link.rssi is None


def test_only_a_radio_can_restart_a_vehicle(link):
    with pytest.raises(RefusedError, match="only a radio link"):
        link.reboot()
    assert link.state is LinkState.CONNECTED


def test_a_link_is_opened_once(link):
    with pytest.raises(CrazyflieError, match="once only"):
        link.connect()
    link.close()
    link.close()
    assert link.state is LinkState.DISCONNECTED
    with pytest.raises(LinkLostError, match="the link was closed"):
        link.parameters.values()
    with pytest.raises(CrazyflieError, match="once only"):
        link.connect()


def test_nothing_works_before_connecting(vehicle, make_link):
    link = make_link(vehicle.uri)
    with pytest.raises(LinkLostError, match="not connected yet"):
        link.setpoints.stop()


def test_an_error_while_sending_ends_the_link_and_not_the_senders(link):
    def fail(packet):
        raise OSError("broken")

    inner = link.link()
    cflib = inner.cflib
    cflib.link.send_packet = fail
    with ThreadPoolExecutor() as pool:
        sending = [pool.submit(cflib.send_packet, MagicMock()) for _ in range(3)]
        assert [result.result(timeout=LIMIT) for result in sending] == [None] * 3
    assert "cannot send: broken" in str(inner.error)
