"""Connections that succeed, fail, get stuck, are lost and come back."""

import queue
import threading
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import MagicMock

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from crazyflie_py.address import Address
from crazyflie_py.backend import Backend, packet
from crazyflie_py.crazyflie import LinkState
from crazyflie_py.errors import (
    CrazyflieError,
    LinkLostError,
    NoAnswerError,
    NoReplyError,
    RefusedError,
    SetupError,
    UnknownNameError,
    ValueRangeError,
)
from crazyflie_py.link import Limits, Link
from crazyflie_py.log import LogBlock

LIMIT = 60.0
QUICK = Limits(first_answer=0.4)


class States:
    """The states that a link goes through, to be waited for."""

    def __init__(self):
        self._states = queue.Queue()

    def __call__(self, state, text):
        self._states.put((state, text))

    def wait_for(self, state):
        while True:
            seen, text = self._states.get(timeout=LIMIT)
            if seen is state:
                return text


@pytest.fixture
def states():
    return States()


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


def test_nobody_there(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.close()
    with pytest.raises(NoAnswerError, match=f"{vehicle.uri}: nothing listens on this port"):
        make_link(vehicle.uri, limits=QUICK).connect()


def test_the_port_is_open_but_silent(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.is_frozen = True
    link = make_link(vehicle.uri, limits=QUICK)
    with pytest.raises(NoAnswerError, match="nobody has answered within 0.4 s"):
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
            make_link(vehicle.uri, limits=Limits(stall=1.0)).connect()
        return str(caught.value)

    with ThreadPoolExecutor(len(STUCK)) as pool:
        for (_, step), text in zip(STUCK, pool.map(connect, STUCK), strict=True):
            assert f"the connection is stuck ({step}) for 1 s" in text


def test_a_set_up_that_takes_too_long(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.lose = lambda count: count % 2 == 0
    limits = Limits(stall=5.0, total=1.0)
    with pytest.raises(SetupError, match="not connected after 1 s"):
        make_link(vehicle.uri, limits=limits).connect()


def test_firmware_that_is_too_old(make_vehicle, make_link):
    vehicle = make_vehicle(protocol=3)
    with pytest.raises(SetupError, match="the firmware speaks protocol 3, at least 4 is needed"):
        make_link(vehicle.uri).connect()


def test_a_stuck_vehicle_stops_nobody_else(make_vehicle, make_link):
    stuck = make_vehicle()
    stuck.deaf.add((4, 0, b""))
    good = [make_vehicle() for _ in range(4)]
    with ThreadPoolExecutor() as pool:
        stuck_link = make_link(stuck.uri, limits=Limits(stall=LIMIT))
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
    link = make_link(vehicle.uri, limits=Limits(stall=LIMIT))
    with ThreadPoolExecutor() as pool:
        connecting = pool.submit(link.connect)
        vehicle.wait_for_packets(4, 0)
        link.close()
        assert isinstance(connecting.exception(timeout=LIMIT), LinkLostError)


def test_a_frozen_vehicle_is_lost_and_taken_up_again(vehicle, make_link, states):
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    received = queue.Queue()
    variables = ("stateEstimate.x", "pm.state")
    link.add_log_block(LogBlock("test", 10, variables, lambda *data: received.put(data)))
    assert received.get(timeout=LIMIT)[1] == (1.5, -1)
    vehicle.is_frozen = True
    assert "has not been heard for 0.45 s" in states.wait_for(LinkState.LOST)
    with pytest.raises(LinkLostError, match="has not been heard"):
        link.setpoints.stop()
    # As after a restart: it sends nothing by itself.
    vehicle.forget_logs()
    while not received.empty():
        received.get()
    vehicle.is_frozen = False
    assert "connected to" in states.wait_for(LinkState.CONNECTED)
    assert received.get(timeout=LIMIT)[1] == (1.5, -1)
    link.setpoints.stop()
    vehicle.wait_for_packets(7, 0)


def test_a_vehicle_that_is_heard_again_soon_needs_no_set_up(vehicle, make_link, states):
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    link.add_log_block(LogBlock("test", 10, ("pm.vbat",), lambda *_: None))
    vehicle.received.clear()
    vehicle.is_frozen = True
    states.wait_for(LinkState.LOST)
    # What has to be tried all the same.
    link.supervisor.emergency_stop()
    vehicle.is_frozen = False
    assert "is heard again" in states.wait_for(LinkState.CONNECTED)
    assert link.links == 1
    assert vehicle.packets(13, 1) == []
    link.setpoints.stop()
    vehicle.wait_for_packets(7, 0)


def test_a_restart_that_pings_do_not_show(vehicle, make_link, states):
    """The firmware restarts within 0.2 s: it answers, but knows no log blocks."""
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    received = queue.Queue()
    link.add_log_block(LogBlock("test", 20, ("pm.vbat",), lambda *data: received.put(data)))
    received.get(timeout=LIMIT)
    vehicle.forget_logs()
    vehicle._blocks.clear()
    assert "the log data have stopped although" in states.wait_for(LinkState.LOST)
    states.wait_for(LinkState.CONNECTED)
    while not received.empty():
        received.get()
    received.get(timeout=LIMIT)


def test_a_restart_takes_the_trajectories_along(vehicle, link):
    received = queue.Queue()
    link.add_log_block(LogBlock("test", 20, ("pm.vbat",), lambda *data: received.put(data)))
    received.get(timeout=LIMIT)
    link.high_level.define_trajectory(3, 0, 1)
    link.high_level.start_trajectory(3)
    with pytest.raises(RefusedError, match="4 has not been uploaded .*; known: 3"):
        link.high_level.start_trajectory(4)
    assert link.restarts == 0
    # The clock of a vehicle that was switched on a moment ago; the fake one's counts on.
    now = int.from_bytes(received.get(timeout=LIMIT)[0].to_bytes(4, "little")[:3], "little")
    vehicle.say(5, 2, b"\1" + ((now - 60_000) % (1 << 24)).to_bytes(3, "little") + bytes(4))
    assert vehicle.wait_for(lambda: link.restarts == 1, LIMIT)
    with pytest.raises(RefusedError, match="known: none"):
        link.high_level.start_trajectory(3)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(packets=st.lists(st.binary(max_size=31), min_size=1, max_size=10))
def test_no_packet_ends_the_thread_that_receives(shared, packets):
    vehicle, link, _ = shared
    for datagram in packets:
        vehicle.say_datagram(datagram)
    assert link.link().cflib.incoming.is_alive()
    # The answer comes through the same thread, after all of them.
    assert link.parameters.read("ring.effect") == 6


@settings(max_examples=30, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    packets=st.lists(
        st.tuples(st.sampled_from([2, 4, 5, 13]), st.integers(0, 3), st.binary(max_size=30)),
        max_size=20,
    )
)
def test_no_packet_ends_the_set_up_without_a_reason(packets):
    link = Link(Address.parse("udp://127.0.0.1:1"), backend=Backend)
    for port, channel, data in packets:
        link.cflib.packet_received.call(packet(port, channel, data))
    link.close()


def test_the_end_of_a_link_is_not_the_end_of_the_flight(vehicle, make_link, states):
    link = make_link(vehicle.uri, on_state=states)
    link.connect()
    vehicle.deaf.add((15, 0, b""))
    states.wait_for(LinkState.LOST)
    link.close()
    # A setpoint, even of zero thrust, would take the vehicle from its own planner.
    assert vehicle.packets(3, 0) == []


def test_a_vehicle_that_is_gone(vehicle, make_link, states):
    link = make_link(vehicle.uri, on_state=states)
    link.connect()
    vehicle.close()
    assert "the link was lost" in states.wait_for(LinkState.LOST)
    with pytest.raises(LinkLostError):
        link.high_level.land(0.0, 1.0)


def test_the_error_of_a_driver_blocks_no_sender(vehicle, make_link, states):
    """Where setpoints meet the error of a closed port, cflib by itself deadlocks."""
    before = set(threading.enumerate())
    link = make_link(vehicle.uri, on_state=states)
    link.connect()
    stop = threading.Event()

    def stream():
        while not stop.is_set():
            try:
                link.setpoints.attitude(0, 0, 0, 0)
            except LinkLostError:
                return True
        return False

    with ThreadPoolExecutor() as pool:
        streaming = [pool.submit(stream) for _ in range(2)]
        vehicle.close()
        states.wait_for(LinkState.LOST)
        stop_timer = threading.Timer(LIMIT, stop.set)
        stop_timer.start()
        assert all(result.result(timeout=2 * LIMIT) for result in streaming)
        stop_timer.cancel()
    link.close()
    assert not any(t.name == "ping_thread" for t in set(threading.enumerate()) - before)


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
    with pytest.raises(RefusedError, match="'big': the vehicle says: No more memory"):
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
        vehicle.say(0, 0, data[k : k + 5])
    assert [lines.get(timeout=LIMIT) for _ in range(2)] == ["SYS: ----", "EST: Größe"]


def test_all_packets_can_be_received_and_a_bad_callback_ends_nothing(vehicle, make_link, caplog):
    received = queue.Queue()

    def on_packet(*packet):
        received.put(packet)
        raise RuntimeError("a bad callback")

    link = make_link(vehicle.uri, on_packet=on_packet)
    link.connect()
    vehicle.say(13, 2, b"app")
    while received.get(timeout=LIMIT) != (13, 2, b"app"):
        pass
    assert link.parameters.read("ring.effect") == 6
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
