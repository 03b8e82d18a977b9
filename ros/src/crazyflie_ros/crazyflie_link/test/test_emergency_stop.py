"""The emergency stop, on links that are silent, being opened, or lose packets."""

import contextlib
import threading

import pytest

from crazyflie_link.crazyflie import LinkState
from crazyflie_link.errors import CrazyflieError
from crazyflie_link.link import LinkTimeouts
from crazyflie_link.supervisor import EmergencyStop
from crazyflie_utils.testing.programs import wait_until

LIMIT = 60.0
STOP, OLD_STOP = b"\x03", b"\x03"
"""On port 9, channel 1; before protocol 12 on port 6, channel 1."""

READY, LOCKED = b"\x8c\x0a\x00", b"\x8c\x42\x00"

PATIENT = LinkTimeouts(first_answer=LIMIT, stall=LIMIT, total=LIMIT)

pytestmark = pytest.mark.filterwarnings("ignore:The supervisor subsystem:UserWarning")


def answer_state(vehicle, state):
    vehicle.answers[9, 0, 0x0C] = state


def stops(vehicle):
    return vehicle.packets(9, 1).count(STOP)


def pings(vehicle, count):
    """Wait for so many more pings, which come at 10 Hz."""
    vehicle.wait_for_packets(15, 0, len(vehicle.packets(15, 0)) + count)


def assert_is_over(vehicle):
    pings(vehicle, 1)
    count = stops(vehicle)
    pings(vehicle, 4)
    assert stops(vehicle) == count


def test_it_is_repeated_until_the_vehicle_is_locked(vehicle, link):
    answer_state(vehicle, READY)
    link.supervisor.emergency_stop()
    assert link.supervisor.wait_for_emergency_stop(0.0) is False
    vehicle.wait_for_packets(9, 1, 20)
    assert set(vehicle.packets(7, 0)) == {b"\0"}
    answer_state(vehicle, LOCKED)
    assert link.supervisor.wait_for_emergency_stop(LIMIT)
    assert_is_over(vehicle)


def test_it_goes_out_first_on_a_link_that_is_being_opened(make_vehicle, make_link):
    vehicle = make_vehicle()
    # It says which protocol it speaks; its tables never come.
    vehicle.deaf.add((5, 0, b""))
    answer_state(vehicle, LOCKED)
    link = make_link(vehicle.uri, limits=PATIENT)
    connecting = threading.Thread(target=ignore_failure(link.connect))
    connecting.start()
    vehicle.wait_for_packets(5, 0)
    link.supervisor.emergency_stop()
    vehicle.wait_for_packets(9, 1)
    assert link.supervisor.wait_for_emergency_stop(LIMIT)
    link.close()
    connecting.join(LIMIT)


def test_it_is_sent_in_both_forms_as_long_as_the_protocol_is_unknown(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.deaf.add((15, 1, b""))
    link = make_link(vehicle.uri, limits=PATIENT)
    connecting = threading.Thread(target=ignore_failure(link.connect))
    connecting.start()
    vehicle.wait_for_packets(15, 1)
    link.supervisor.emergency_stop()
    assert vehicle.wait_for_packets(9, 1)[0] == STOP
    assert vehicle.wait_for_packets(6, 1)[0] == OLD_STOP
    link.close()
    connecting.join(LIMIT)


def test_it_was_pressed_before_the_link_is_opened(make_vehicle, make_link):
    vehicle = make_vehicle()
    vehicle.deaf.add((5, 0, b""))
    link = make_link(vehicle.uri, limits=PATIENT)
    link.supervisor.emergency_stop()
    connecting = threading.Thread(target=ignore_failure(link.connect))
    connecting.start()
    vehicle.wait_for_packets(9, 1)
    link.close()
    connecting.join(LIMIT)


def test_it_was_pressed_while_the_link_is_silent(vehicle, make_link, states):
    """The tables of the new link never come; no need to wait for them."""
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    vehicle.is_frozen = True
    states.wait_for(LinkState.LOST)
    link.supervisor.emergency_stop()
    wait_until(lambda: link._opening is not None, "a new attempt")
    vehicle.deaf.add((5, 0, b""))
    vehicle.received.clear()
    answer_state(vehicle, LOCKED)
    vehicle.is_frozen = False
    vehicle.wait_for_packets(9, 1)
    assert link.supervisor.wait_for_emergency_stop(LIMIT)


def test_a_link_that_is_set_up_again_begins_with_it(vehicle, make_link, states):
    """The vehicle may have been restarted meanwhile, and must not fly before it is added again."""
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    answer_state(vehicle, LOCKED)
    link.supervisor.emergency_stop()
    assert link.supervisor.wait_for_emergency_stop(LIMIT)
    vehicle.is_frozen = True
    states.wait_for(LinkState.LOST)
    wait_until(lambda: link._opening is not None, "a new attempt")
    vehicle.received.clear()
    vehicle.is_frozen = False
    vehicle.wait_for_packets(9, 1)


def test_no_attempt_to_connect_waits_long(vehicle, make_link, states, monkeypatch):
    monkeypatch.setattr("crazyflie_link.crazyflie.FIRST_PAUSE", LIMIT)
    monkeypatch.setattr("crazyflie_link.crazyflie.LONGEST_PAUSE", LIMIT)
    link = make_link(vehicle.uri, reconnect=True, on_state=states)
    link.connect()
    vehicle.close()
    while "nothing listens" not in states.wait_for(LinkState.LOST) or link._opening:
        pass
    attempts = []
    monkeypatch.setattr(link, "_open", lambda: attempts.append(True) or fail())
    link.supervisor.emergency_stop()
    wait_until(lambda: len(attempts) >= 3, "attempts")


@pytest.mark.parametrize("protocol", [4, 11])
def test_firmware_that_does_not_tell_gets_it_several_times(make_vehicle, make_link, protocol):
    vehicle = make_vehicle(protocol=protocol)
    link = make_link(vehicle.uri)
    link.connect()
    link.supervisor.emergency_stop()
    assert link.supervisor.wait_for_emergency_stop(LIMIT)
    assert len(vehicle.packets(6, 1)) >= 5
    assert vehicle.packets(9, 0) == vehicle.packets(9, 1) == []


def test_silent_firmware_that_does_not_tell_gets_it_when_it_is_heard(
    make_vehicle, make_link, states
):
    vehicle = make_vehicle(protocol=11)
    link = make_link(vehicle.uri, on_state=states)
    link.connect()
    vehicle.is_frozen = True
    states.wait_for(LinkState.LOST)
    link.supervisor.emergency_stop()
    assert link.supervisor.wait_for_emergency_stop(0.5) is False
    vehicle.received.clear()
    vehicle.is_frozen = False
    assert len(vehicle.wait_for_packets(6, 1, 5)) >= 5


def test_it_does_not_wait_for_a_pile_of_commands(vehicle, link):
    free, stuck = threading.Event(), threading.Event()

    def block():
        stuck.set()
        free.wait(LIMIT)

    inner = link.link()
    inner.put(block)
    stuck.wait(LIMIT)
    for _ in range(100):
        inner.send(13, 3, b"")
    link.supervisor.emergency_stop()
    # Repetitions that could not be sent do not pile up.
    assert link.supervisor.wait_for_emergency_stop(0.5) is False
    vehicle.received.clear()
    free.set()
    vehicle.wait_for_packets(13, 3, 100)
    ports = [port for port, channel, _ in vehicle.received if (port, channel) in ((9, 1), (13, 3))]
    assert ports[0] == 9
    assert ports.count(9) < 5


class HeardLink:
    """A link to a vehicle that is heard after every packet."""

    def __init__(self, protocol):
        self.protocol, self.cflib = protocol, self
        self.bursts = []
        self.emergency = EmergencyStop(lambda: self)

    def put(self, send, urgent=False):
        self.bursts.append([])
        send()
        self.emergency.receive(15, 0, b"")

    def put_latest(self, stream, send):
        self.put(send)

    def send_packet(self, packet):
        self.bursts[-1].append((packet.port, packet.channel, bytes(packet.data)))


@pytest.mark.parametrize("protocol", [0, 11])
def test_firmware_that_does_not_tell_gets_it_once_and_five_times_more(protocol):
    link = HeardLink(protocol)
    link.emergency.begin()
    assert link.emergency.wait(LIMIT)
    link.emergency.close()
    assert link.bursts == [[(6, 1, OLD_STOP), (7, 0, b"\0")]] * 6


@pytest.mark.parametrize(
    ("protocol", "first"), [(-1, [(9, 1, STOP), (6, 1, OLD_STOP)]), (12, [(9, 1, STOP)])]
)
def test_only_a_report_that_it_is_locked_ends_it(protocol, first):
    link = HeardLink(protocol)
    link.emergency.receive(9, 0, LOCKED)
    link.emergency.begin()
    for packet in ((9, 1, LOCKED), (9, 0, LOCKED[:2]), (9, 0, b"\x8d" + LOCKED[1:]), (9, 0, READY)):
        link.emergency.receive(*packet)
        assert not link.emergency.wait(0.0)
    link.emergency.receive(9, 0, LOCKED)
    assert link.emergency.wait(0.0)
    link.emergency.close()
    assert link.bursts[0] == [*first, (7, 0, b"\0"), (9, 0, b"\x0c")]


def ignore_failure(work):
    def run():
        with contextlib.suppress(CrazyflieError):
            work()

    return run


def fail():
    raise CrazyflieError("no")
