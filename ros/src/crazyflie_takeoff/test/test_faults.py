"""Faults in whole flights: vehicle, controller, filter and server on hand-moved time."""

import threading

import pytest
from std_msgs.msg import Bool, Empty, Float32, String
from std_srvs.srv import EmptyRequest
from takeoff_helpers import FILTER, SERVER, HoverNetwork, control, state

from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_takeoff.all_emergency_node import AllEmergencyNode
from crazyflie_takeoff.takeoff_control_filter_node import TakeoffControlFilterNode
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.runtime.transport import ServiceError
from crazyflie_utils.testing import FakeProcess

G = 9.81


@pytest.fixture
def network():
    """Return a vehicle that hovers."""
    network = HoverNetwork(SERVER)
    network.take_off()
    return network


def states(network):
    return [message.data for _, message in network.on("/in_flight_state")]


def thrusts(network, since=0.0, topic="/control/final"):
    return [message.control.thrust for _, message in network.on(topic, since)]


def until_on_ground(network):
    network.advance_until(lambda: network.last("/in_flight_state") == "on_ground")
    network.advance(0.5)


# Losing control.


def test_motion_capture_is_lost_and_comes_back(network):
    """The vehicle comes down, and stays there when the pose returns."""
    lost = network.time
    network.vehicle_node.sees = False
    network.advance(4.0)
    network.vehicle_node.sees = True
    until_on_ground(network)
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 1.0
    assert len(network.on("/in_flight")) == 2
    grounded = network.time
    network.advance(10.0)
    assert len(network.on("/control/lqr", grounded)) > 900
    assert set(thrusts(network, grounded)) == {0.0}
    assert max(thrusts(network, lost)) < 1.2 * G
    assert network.vehicle.z == 0.0
    # And flies again if it is asked to.
    network.take_off()
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)


def test_a_short_loss_changes_nothing(network):
    network.vehicle_node.sees = False
    network.advance(0.5)
    assert "no control comes" in network.last("/in_flight_status")
    network.vehicle_node.sees = True
    network.advance(2.0)
    assert network.last("/in_flight_state") == "flying"
    assert network.last("/in_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


def test_the_controller_dies(network):
    network.kill("controller")
    network.process("filter").transport.unpublished.add("/control/lqr")
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    assert states(network)[-2:] == ["landing", "on_ground"]
    status = network.last("/in_flight_status")
    assert "takeoff refused: no commanded controls come" in status
    with pytest.raises(ServiceError, match="no commanded controls come"):
        network.call("/takeoff")


def test_a_frozen_controller_keeps_takeoff_refused_until_it_speaks(network):
    """It is still connected, as a process that was stopped is."""
    network.kill("controller")
    until_on_ground(network)
    network.advance(1.0)
    with pytest.raises(ServiceError, match="no commanded controls come"):
        network.call("/takeoff")
    network.process("filter").publish("/control/lqr", control(4.0))
    network.advance(0.2)
    assert not network.call("/takeoff").done()


def test_a_filter_that_is_still_down_does_not_end_the_next_takeoff():
    process = FakeProcess()
    assert process.launch(TakeoffServerNode(), "/takeoff_server", SERVER)
    process.publish("/state", state(0.0))
    process.publish("/in_flight_filter", String("down from on_ground: brought down"))
    process.advance(0.1)
    takeoff = process.call("/takeoff", EmptyRequest())
    process.publish("/in_flight_filter", String("down from taking_off: brought down"))
    process.advance(0.1)
    assert word(process) == "taking_off"
    assert not takeoff.done()


@pytest.mark.parametrize("pose", [True, False])
def test_the_filter_alone_brings_the_vehicle_down(network, pose):
    network.kill("server")
    network.kill("controller")
    network.vehicle_node.sees = pose
    network.advance(8.0)
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 1.0
    assert thrusts(network)[-1] == 0.0
    network.start_server()
    network.vehicle_node.sees = True
    network.advance(2.0)
    assert network.last("/in_flight_state") == "on_ground"
    # Who knows only the toggle is told by the new server.
    assert len(network.on("/in_flight")) == 2


def test_a_server_that_starts_during_the_descent_leaves_it_alone(network):
    network.kill("server")
    network.vehicle_node.sees = False
    network.advance(1.5)
    network.start_server()
    until_on_ground(network)
    assert 0.0 not in thrusts(network, 0.0, "/control/takeoff")[-3:-2] or network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 1.0


def test_a_filter_that_dies_in_its_descent_leaves_a_landing(network):
    network.kill("controller")
    network.advance(1.0)
    assert network.last("/in_flight_state") == "landing"
    network.kill("filter")
    network.advance(0.3)
    network.start_filter()
    until_on_ground(network)
    assert thrusts(network)[-1] == 0.0


def test_a_filter_that_was_gone_for_long_does_not_lift_the_vehicle_off_the_floor(network):
    """The vehicle has stopped its motors and fallen meanwhile."""
    network.kill("filter")
    network.advance(3.0)
    assert network.vehicle.z == 0.0
    begun = network.time
    network.start_filter()
    network.advance(5.0)
    assert network.vehicle.z == 0.0
    assert set(thrusts(network, begun)) == {0.0}
    assert network.last("/in_flight_state") == "on_ground"
    network.take_off()


def test_the_pose_is_lost_in_a_landing(network):
    """The ramp would let it fall."""
    network.call("/land")
    network.advance(1.0)
    network.vehicle_node.sees = False
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 1.0


def test_takeoff_without_a_controller_that_follows():
    network = HoverNetwork(SERVER)
    network.kill("controller")
    network.advance(0.5)
    future = network.call("/takeoff")
    network.advance_until(future.done, 4.0)
    with pytest.raises(ServiceError, match="ended by the filter: no control came"):
        future.result(0)
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    assert "landing" in states(network)


def test_takeoff_of_a_vehicle_that_cannot_fly():
    """It is locked, or its driver sends it nothing."""
    network = HoverNetwork(SERVER)
    network.vehicle.command = lambda thrust: None
    network.advance(0.5)
    future = network.call("/takeoff")
    network.advance_until(future.done, 10.0)
    with pytest.raises(ServiceError, match="the vehicle has not lifted off; can it fly"):
        future.result(0)
    until_on_ground(network)
    assert "flying" not in states(network)
    assert network.last("/in_flight_status") == "on ground: the vehicle has not lifted off"
    assert set(thrusts(network, network.time - 0.3)) == {0.0}


# Emergencies.


def test_emergency_stops_at_once_and_stays(network):
    called = network.time
    network.process("filter").call("/emergency", EmptyRequest())
    assert network.process("filter").published("/control/final")[-1].control.thrust == 0.0
    network.advance(3.0)
    assert network.vehicle.z == 0.0
    assert set(thrusts(network, called)) == {0.0}
    assert len(thrusts(network, called)) >= 290
    assert network.last("/in_flight_state") == "on_ground"
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


# Landing.


@pytest.mark.parametrize("moment", [0.3, 1.3, 3.0])
def test_land_aborts_a_takeoff(moment):
    network = HoverNetwork(SERVER)
    network.advance(0.5)
    takeoff = network.call("/takeoff")
    network.advance(moment)
    land = network.call("/land")
    with pytest.raises(ServiceError, match="takeoff aborted: /land was called"):
        takeoff.result(0)
    network.advance_until(land.done)
    assert land.exception() is None
    assert network.vehicle.z == 0.0 or network.vehicle.z < 0.05
    assert network.vehicle.touchdown_speed < 0.5


def test_the_descent_has_a_topic_of_its_own(network):
    network.call("/land")
    begun = network.time
    network.advance(1.0)
    own = [message for _, message in network.on("/ref_descent", begun)]
    shared = [message for _, message in network.on("/ref", begun)]
    assert own == shared
    assert len(own) == pytest.approx(100, abs=2)
    assert isinstance(own[0], PositionVelocityStateStamped)
    until_on_ground(network)
    network.take_off()
    assert network.on("/ref")[-1][0] > network.on("/ref_descent")[-1][0]


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
    assert network.last("/in_flight_state") in ("on_ground", "flying")
    assert network.vehicle.touchdown_speed < 0.5
    final = thrusts(network)
    assert max(final) <= 16.0
    # No zero thrust between two others.
    first = next((k for k, thrust in enumerate(final) if thrust > 0.0), len(final))
    last = max((k for k, thrust in enumerate(final) if thrust > 0.0), default=0)
    assert 0.0 not in final[first:last]


# The battery.


def with_battery(z, said):
    process = FakeProcess()
    parameters = {**SERVER, "topics/battery": "/battery"}
    assert process.launch(TakeoffServerNode(), "/takeoff_server", parameters)
    process.publish("/in_flight_filter", String(said))
    discharge(process, 4.0, 1.0, z)
    return process


def discharge(process, voltage, duration, z=0.0):
    for k in range(round(duration * 10)):
        if k % 10 == 0:
            process.publish("/battery", Float32(voltage))
        process.publish("/state", state(z))
        process.advance(0.1)


def word(process):
    return process.published("/in_flight_state")[-1].data


def test_a_low_battery_keeps_on_the_ground():
    process = with_battery(0.0, "on_ground")
    discharge(process, 3.1, 4.0)
    assert process.published("/in_flight_status")[-1].data == "on ground"
    discharge(process, 3.1, 3.0)
    with pytest.raises(ServiceError, match="/takeoff refused: the battery is low, 3.10 V"):
        process.call("/takeoff", EmptyRequest())
    assert "the battery is low" in process.logged("warn")[0]
    discharge(process, 4.1, 1.0)
    assert not process.call("/takeoff", EmptyRequest()).done()


def test_a_critical_battery_lands():
    process = with_battery(1.0, "flying")
    for voltage, duration in ((2.9, 4.0), (3.3, 1.0), (3.1, 10.0), (2.9, 4.0)):
        discharge(process, voltage, duration, 1.0)
        assert word(process) == "flying"
    discharge(process, 2.9, 3.0, 1.0)
    assert word(process) == "descending"
    status = process.published("/in_flight_status")[-1].data
    assert status == "descending: the battery is low, 2.90 V"


def test_a_battery_that_is_silent_or_not_a_number_says_nothing():
    process = with_battery(1.0, "flying")
    discharge(process, 2.9, 3.0, 1.0)
    for _ in range(10):
        process.publish("/battery", Float32(float("nan")))
        process.publish("/state", state(1.0))
        process.advance(1.0)
    process.publish("/battery", Float32(2.9))
    process.advance(0.1)
    assert word(process) == "flying"


# What people are told.


def test_status_in_words():
    process = FakeProcess()
    assert process.launch(TakeoffServerNode(), "/takeoff_server", SERVER)
    process.advance(0.2)
    process.publish("/in_flight_filter", String("on_ground"))
    process.publish("/in_flight_controller", Bool(True))
    process.advance(2.0)
    process.publish("/state", state(0.0))
    process.advance(0.3)
    said = [message.data for message in process.published("/in_flight_status")]
    assert said[0] == "looking where the flight stands"
    assert said[1].startswith("on ground: takeoff refused: no state has come on /state")
    assert said[2] == "on ground"


def test_diagnostics(network):
    network.kill("controller")
    network.advance(2.0)
    for name in ("server", "filter"):
        status = network.process(name).published("/diagnostics")[-1].status[0]
        assert status.name == name
        assert status.level == 2
        assert "no control came for 0.6 s" in status.message
    until_on_ground(network)
    network.advance(1.0)
    levels = [
        network.process(name).published("/diagnostics")[-1].status[0].level
        for name in ("server", "filter")
    ]
    assert levels == [1, 0]


# The geofence.


def test_a_hover_point_outside_the_geofence_is_refused():
    process = FakeProcess()
    fence = {"box/max/z": 0.9, "box/min/x": -1.0}
    assert not process.launch(TakeoffServerNode(), "/takeoff_server", {**SERVER, **fence})
    assert "0.10 m outside the geofence" in process.logged("error")[0]


# The end of the launch.


def flights(network):
    return [message.data for _, message in network.on("/flights")]


def test_a_server_that_is_to_leave_lands_first(network):
    assert flights(network)[-1].endswith(" in flight")
    network.server.leave()
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    assert flights(network)[-1].endswith(" on ground")
    assert network.last("/in_flight_status") == "on ground: the launch is to end"


def test_from_far_above_a_server_that_is_to_leave_lands_faster():
    network = HoverNetwork({**SERVER, "hover/z": 4.0, "duration/hover": 10.0})
    network.take_off()
    assert network.vehicle.z > 3.9
    begin = network.time
    network.server.leave()
    until_on_ground(network)
    assert network.time - begin < 10.0
    assert network.vehicle.touchdown_speed < 1.0


def test_a_server_that_is_to_leave_aborts_a_takeoff():
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    takeoff = network.call("/takeoff")
    network.advance(3.0)
    network.server.leave()
    with pytest.raises(ServiceError, match="takeoff aborted: .* is to end"):
        takeoff.result(timeout=0)
    until_on_ground(network)
    assert network.vehicle.z == 0.0


def test_on_the_ground_there_is_nothing_to_land():
    network = HoverNetwork(SERVER)
    network.advance(1.0)
    network.server.leave()
    network.advance(1.0)
    assert states(network) == ["on_ground"]
