"""Connections that are lost and come back, and what must not end one."""

import queue
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from crazyflie_link.address import Address
from crazyflie_link.cflib_internals import packet
from crazyflie_link.crazyflie import LinkState
from crazyflie_link.errors import LinkLostError, RefusedError
from crazyflie_link.link import Link, LinkTimeouts
from crazyflie_link.log import LogBlock

LIMIT = 60.0


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


def test_without_a_link_the_reason_is_that_of_the_last_attempt(vehicle, make_link, states):
    limits = LinkTimeouts(first_answer=0.2)
    link = make_link(vehicle.uri, reconnect=True, on_state=states, limits=limits)
    link.connect()
    vehicle.is_frozen = True
    while "no answer has come" not in states.wait_for(LinkState.LOST):
        pass
    with pytest.raises(LinkLostError, match="no link to the vehicle: .* no answer has come"):
        link.setpoints.stop()
    link.close()
    with pytest.raises(LinkLostError, match="no link to the vehicle: the link was closed"):
        link.setpoints.stop()


def test_a_vehicle_that_is_heard_again_soon_needs_no_set_up(vehicle, make_link, states):
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    link.add_log_block(LogBlock("test", 10, ("pm.vbat",), lambda *_: None))
    vehicle.received.clear()
    vehicle.is_frozen = True
    states.wait_for(LinkState.LOST)
    # An attempt that must still be made.
    link.supervisor.emergency_stop()
    vehicle.is_frozen = False
    assert "is heard again" in states.wait_for(LinkState.CONNECTED)
    assert link.connection_count == 1
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
    assert "the log data have stopped although" in states.wait_for(LinkState.LOST)
    states.wait_for(LinkState.CONNECTED)
    while not received.empty():
        received.get()
    received.get(timeout=LIMIT)


def test_a_restart_takes_the_trajectories_along(vehicle, link):
    received = queue.Queue()
    link.add_log_block(LogBlock("test", 20, ("pm.vbat",), lambda *data: received.put(data)))
    received.get(timeout=LIMIT)
    link.high_level.define_trajectory(3, range(132), 1)
    link.high_level.start_trajectory(3)
    with pytest.raises(RefusedError, match="4 has not been uploaded .*; known: 3"):
        link.high_level.start_trajectory(4)
    assert link.restarts == 0
    # The clock of a vehicle that was switched on a moment ago; the fake one's counts on, which is
    # no restart: it may have been late by so much.
    now = int.from_bytes(received.get(timeout=LIMIT)[0].to_bytes(4, "little")[:3], "little")
    vehicle.send(5, 2, b"\1" + ((now - 30_000) % (1 << 24)).to_bytes(3, "little") + bytes(4))
    assert vehicle.wait_for(lambda: link.restarts == 1, LIMIT)
    with pytest.raises(RefusedError, match="known: none"):
        link.high_level.start_trajectory(3)


@settings(suppress_health_check=list(HealthCheck))
@given(packets=st.lists(st.binary(max_size=31), min_size=1, max_size=10))
def test_no_packet_ends_the_thread_that_receives(shared, packets):
    vehicle, link, _ = shared
    for datagram in packets:
        vehicle.send_datagram(datagram)
    assert link.link().cflib.incoming.is_alive()
    # The answer comes through the same thread, after all of them.
    assert link.parameters.read("ring.effect") == 6


@settings(suppress_health_check=list(HealthCheck))
@given(
    packets=st.lists(
        st.tuples(st.sampled_from([2, 4, 5, 13]), st.integers(0, 3), st.binary(max_size=30)),
        max_size=20,
    )
)
def test_no_packet_ends_the_set_up_without_a_reason(packets):
    link = Link(Address.parse("udp://127.0.0.1:1"))
    # It must raise nothing: an exception would end the receiving thread.
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
