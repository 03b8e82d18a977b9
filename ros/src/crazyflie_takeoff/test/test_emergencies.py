"""Emergencies, and many callers at once."""

import threading

import pytest
from flight_words import thrusts
from std_msgs.msg import Empty
from std_srvs.srv import EmptyRequest
from takeoff_helpers import FILTER, SERVER, HoverNetwork

from crazyflie_takeoff.all_emergency_node import AllEmergencyNode
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing import FakeProcess

G = 9.81


# Emergencies.


def test_emergency_stops_at_once_and_stays(network):
    called = network.time
    network.process("filter").call("/emergency", EmptyRequest())
    assert network.last_of("filter", "/control/final").control.thrust == 0.0
    network.advance(3.0)
    assert network.vehicle.z == 0.0
    assert set(thrusts(network, called)) == {0.0}
    assert len(thrusts(network, called)) >= 290
    assert network.last("/in_flight_flight_status") == "on_ground"
    assert len(network.on("/in_flight")) == 2
    with pytest.raises(ServiceError, match="emergency, /emergency was called"):
        network.call("/takeoff")
    network.process("filter").call("/emergency_reset", EmptyRequest())
    network.advance(0.5)
    assert set(thrusts(network, called)) == {0.0}
    network.take_off()
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("moment", [0.5, 1.2, 4.0])
def test_emergency_ends_a_takeoff_with_an_error(moment):
    network = HoverNetwork(SERVER)
    network.advance(0.5)
    future = network.call("/takeoff")
    network.advance(moment)
    stopped = network.time
    network.process("filter").publish("/all/emergency", Empty())
    network.advance(2.0)
    with pytest.raises(ServiceError, match="all vehicles were stopped"):
        future.result(0)
    assert set(thrusts(network, stopped)) == {0.0}
    assert network.vehicle.z == 0.0


def test_reset_is_refused_without_an_emergency(network):
    with pytest.raises(ServiceError, match="/emergency_reset refused: there is no emergency"):
        network.process("filter").call("/emergency_reset", EmptyRequest())


def test_one_service_for_all_vehicles():
    process = FakeProcess()
    for name in ("a", "b"):
        names = {f"srv/{each}": f"/{name}/{each}" for each in ("emergency", "emergency_reset")}
        topics = {key: f"/{name}{value}" for key, value in FILTER.items()}
        assert process.launch(TakeoffControlFilterNode(), f"/{name}/filter", {**topics, **names})
    assert process.launch(AllEmergencyNode(), "/all_emergency")
    process.call("/all/emergency", EmptyRequest())
    process.advance(0.5)
    for name in ("a", "b"):
        outputs = process.published(f"/{name}/control/final")
        assert {message.control.thrust for message in outputs} == {0.0}
        assert len(outputs) >= 50


def test_a_call_for_all_is_repeated_for_a_second():
    """For filters that are just starting; and without a call nothing is sent."""
    process = FakeProcess()
    assert process.launch(AllEmergencyNode(), "/all_emergency")
    process.advance(1.0)
    assert process.published("/all/emergency") == []
    process.call("/all/emergency", EmptyRequest())
    assert len(process.published("/all/emergency")) == 1
    process.advance(0.5)
    assert len(process.published("/all/emergency")) == 11
    # Another call restarts the time.
    process.call("/all/emergency", EmptyRequest())
    process.advance(3.0)
    assert len(process.published("/all/emergency")) == 11 + 20


def test_a_call_that_no_filter_receives_is_an_error():
    process = FakeProcess()
    assert process.launch(AllEmergencyNode(), "/all_emergency")
    process.transport.publishers["/all/emergency"].has_subscribers = lambda: False
    with pytest.raises(ServiceError, match="no filter listens on /all/emergency"):
        process.call("/all/emergency", EmptyRequest())


# Many at once.


def hammer(process, services, counts):
    """Call services from as many threads, all at once; return futures and refusals."""
    outcomes, barrier = [], threading.Barrier(sum(counts))

    def ask(service):
        barrier.wait(60.0)
        try:
            outcomes.append((service, process.call(service, EmptyRequest())))
        except ServiceError as refusal:
            outcomes.append((service, refusal))

    threads = [
        threading.Thread(target=ask, args=(service,))
        for service, count in zip(services, counts, strict=True)
        for _ in range(count)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    return outcomes


@pytest.mark.parametrize("service", ["/takeoff", "/land"])
def test_of_twenty_callers_one_wins(service):
    network = HoverNetwork(SERVER)
    network.advance(0.5)
    if service == "/land":
        network.take_off()
    begun = network.time
    outcomes = hammer(network.process("server"), [service], [20])
    refusals = [str(outcome) for _, outcome in outcomes if isinstance(outcome, ServiceError)]
    (winner,) = [outcome for _, outcome in outcomes if not isinstance(outcome, ServiceError)]
    assert len(refusals) == 19
    assert all("is under way" in text for text in refusals)
    network.advance_until(winner.done)
    assert winner.exception() is None
    assert len(network.on("/in_flight", begun)) == 1
    if service == "/takeoff":
        assert thrusts(network, begun, "/control/takeoff") == [G + 0.2] * 100


def test_takeoff_and_landing_at_once_end_on_the_ground_or_in_the_air():
    network = HoverNetwork(SERVER)
    network.advance(0.5)
    hammer(network.process("server"), ["/takeoff", "/land"], [10, 10])
    network.advance(15.0)
    assert network.last("/in_flight_flight_status") in ("on_ground", "flying")
    assert network.vehicle.touchdown_speed < 0.5
    final = thrusts(network)
    assert max(final) <= 16.0
    # No zero thrust between two others.
    first = next((k for k, thrust in enumerate(final) if thrust > 0.0), len(final))
    last = max((k for k, thrust in enumerate(final) if thrust > 0.0), default=0)
    assert 0.0 not in final[first:last]
