"""Messages between processes about flights."""

import signal
import time
from types import SimpleNamespace

import pytest
from std_msgs.msg import String

from crazyflie_utils import Node, main
from crazyflie_utils.context import Flights
from crazyflie_utils.testing import FakeProcess

PILOT = "/cf/pilot"


@pytest.fixture
def process():
    """Return a process that may have flights of its own, and hears of others'."""
    return FakeProcess()


@pytest.fixture
def flights(process):
    """Return the flights that a node of the process is needed for."""
    return Flights(process.topics, ["/cf/sensors/instrument"])


def told(process):
    return [message.data for message in process.published("/flights")]


def test_flights_are_known_until_they_have_ended(process, flights):
    for state, in_flight in (("in flight", [PILOT]), ("on ground", [])):
        process.publish("/flights", String(f"{PILOT} {state}"))
        assert flights.in_flight == in_flight


def test_flights_in_other_namespaces_do_not_matter(process, flights):
    process.publish("/flights", String("/cf2/pilot in flight"))
    assert flights.in_flight == []


def test_a_flight_that_a_node_ends_needs_no_word_of_others(process, flights):
    process.publish("/flights", String(f"{PILOT} in flight"))
    assert flights.unattended(5.0) == [PILOT]
    process.publish("/flights", String(f"{PILOT} in flight, to end"))
    # It flies on, and says so at each change, until it has landed.
    process.publish("/flights", String(f"{PILOT} in flight"))
    assert flights.in_flight == [PILOT]
    assert flights.unattended(5.0) == []


def test_what_was_said_long_ago_does_not_count(process, flights, monkeypatch):
    process.publish("/flights", String(f"{PILOT} in flight, to end"))
    assert flights.unattended(5.0) == []
    assert flights.unattended(0.0) == [PILOT]


def test_a_process_that_is_to_leave_tells_of_its_flights(process):
    tell = process.handle(PILOT).inhibit_shutdown()
    other = process.handle("/other/pilot").inhibit_shutdown()
    assert process.flights.in_flight == []
    tell(True)
    other(False)
    assert process.flights.in_flight == [PILOT]
    process.prepare_shutdown({})
    assert told(process) == [
        f"{PILOT} in flight",
        f"{PILOT} in flight\n/other/pilot on ground",
        f"{PILOT} in flight, to end\n/other/pilot on ground",
    ]
    tell(False)
    assert process.flights.in_flight == []


def test_a_process_that_starts_later_knows_all_flights(process):
    """It is sent the last message on the topic, of whichever node of the process."""
    process.handle("/cf/other").inhibit_shutdown()(True)
    process.handle("/cf2/pilot").inhibit_shutdown()(False)
    later = FakeProcess()
    known = Flights(later.topics, ["/cf/sensors/instrument"])
    later.publish("/flights", process.published("/flights")[-1])
    assert known.in_flight == ["/cf/other"]


def test_a_handle_that_is_closed_has_no_flights(process):
    handle = process.handle(PILOT)
    handle.inhibit_shutdown()(True)
    handle.close()
    assert process.flights.in_flight == []
    # Nobody waits for them any more.
    assert told(process)[-1] == f"{PILOT} on ground"


@pytest.mark.parametrize(
    ("asking", "asked"),
    [
        ("/driver", ["/cf/pilot", "/cf2/pilot"]),
        ("/cf/sensors/instrument", ["/cf/pilot"]),
        ("/cf3/sensors/instrument", []),
    ],
)
def test_who_flies_is_asked_to_land_for_a_node_that_is_to_end(process, asking, asked):
    landed = []
    for pilot in ("/cf/pilot", "/cf2/pilot", "/cf/other"):
        handle = process.handle(pilot)
        handle.inhibit_shutdown(lambda name, pilot=pilot: landed.append((pilot, name)))(
            pilot.endswith("pilot")
        )
    other = FakeProcess()
    other.handle("/other").inhibit_shutdown()(True)
    other.handle(asking).advertise_landing_request()()
    process.publish("/flights", other.published("/flights")[-1])
    assert landed == [(pilot, asking) for pilot in asked]
    # What it says later of its own flights asks no more.
    other.prepare_shutdown({})
    process.publish("/flights", other.published("/flights")[-1])
    assert len(landed) == len(asked)


def test_who_asks_for_a_landing_has_no_flight_of_its_own(process, flights):
    other = FakeProcess()
    other.handle("/cf/driver").inhibit_shutdown()(True)
    process.publish("/flights", other.published("/flights")[-1])
    other.handle("/cf/driver").advertise_landing_request()()
    process.publish("/flights", other.published("/flights")[-1])
    assert flights.in_flight == ["/cf/driver"]


class Pilot(Node):
    needed_in_flight = True


def test_a_signal_that_comes_with_the_notice_ends_the_wait(process, monkeypatch):
    signals = []
    waiting = main.Shutdown(process, {PILOT: Pilot()}, signals)
    process.handle(PILOT).inhibit_shutdown()(True)
    # Who reads the notice may send the signal before the process goes on.
    process.transport.log = lambda level, text: signals.append(signal.SIGINT)

    def sleep(_):
        pytest.fail("the signal does not count")

    clock = SimpleNamespace(monotonic=time.monotonic, sleep=sleep)
    monkeypatch.setattr(main, "time", clock)
    waiting.wait_for_flights()
    assert signals == [signal.SIGINT]
