"""Control is lost in whole flights: vehicle, controller, filter and server on hand-moved time."""

import pytest
from flight_words import states, thrusts, until_on_ground, word
from std_srvs.srv import EmptyRequest
from takeoff_helpers import (
    BARE,
    SERVER,
    ControllerNode,
    HoverNetwork,
    control,
    filter_status,
    state,
)

from crazyflie_msgs.msg import FilterStatus
from crazyflie_takeoff.takeoff_server_node import TakeoffServerNode
from crazyflie_utils.refusal import ServiceError
from crazyflie_utils.testing import FakeProcess

G = 9.81


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
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.last("/in_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


def test_the_controller_dies(network):
    network.kill("controller")
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    assert states(network)[-2:] == ["landing", "on_ground"]
    status = network.last("/in_flight_status")
    assert "takeoff refused: no commanded controls come" in status
    with pytest.raises(ServiceError, match="no commanded controls come"):
        network.call("/takeoff")


def test_a_controller_that_comes_back_within_three_seconds_goes_on(network):
    network.kill("controller")
    network.advance(2.8)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)
    network.start("controller", ControllerNode())
    network.advance(2.0)
    assert network.last("/in_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


def test_an_estimator_that_comes_back_in_time_goes_on(network):
    network.vehicle_node.sees = False
    network.advance(1.5)
    # Without a pose it begins to sink.
    assert 0.8 < network.vehicle.z < 1.0
    network.vehicle_node.sees = True
    network.advance(4.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


def test_a_backlog_of_states_is_no_touchdown(network):
    """A state near the ground that was measured long ago does not stop the motors."""
    network.kill("controller")
    network.advance_until(lambda: "sinking" in network.last("/in_flight_filter_status"))
    network.vehicle_node.sees = False
    for _ in range(20):
        old = state(0.0)
        old.header.stamp = network.process("filter").clock.stamp(network.time - 2.0)
        network.process("filter").publish("/state", old)
        network.advance(0.05)
    assert thrusts(network)[-1] > 5.0
    assert network.vehicle.z > 0.3
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 1.2


def test_a_filter_that_is_to_hold_at_once_flies_all_the_same():
    network = HoverNetwork(SERVER, {"loss/hold_after": 0.0})
    network.take_off()
    network.advance(5.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.01)
    figures = network.last_of("filter", "/diagnostics").status[0].values
    assert {each.key: each.value for each in figures}["takeovers"] == "0"


def test_a_frozen_controller_keeps_takeoff_refused_until_it_speaks(network):
    network.freeze("/controller")
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
    process.publish("/in_flight_filter_status", filter_status("on_ground", FilterStatus.DOWN))
    process.advance(0.1)
    takeoff = process.call("/takeoff", EmptyRequest())
    process.publish("/in_flight_filter_status", filter_status("taking_off", FilterStatus.DOWN))
    process.advance(0.1)
    assert word(process) == "taking_off"
    assert not takeoff.done()


@pytest.mark.parametrize("pose", [True, False])
def test_the_filter_alone_brings_the_vehicle_down(network, pose):
    network.kill("server")
    network.kill("controller")
    network.vehicle_node.sees = pose
    # Blindly for 5 s and 2.5 s from 1 m.
    network.advance(10.0)
    assert network.vehicle.z == 0.0
    assert network.vehicle.touchdown_speed < 1.0
    assert thrusts(network)[-1] == 0.0
    network.start_server()
    network.vehicle_node.sees = True
    network.advance(2.0)
    assert network.last("/in_flight_flight_status") == "on_ground"
    # Who knows only the toggle is told by the new server.
    assert len(network.on("/in_flight")) == 2


def test_a_server_that_starts_during_the_descent_leaves_it_alone(network):
    network.kill("server")
    network.vehicle_node.sees = False
    network.advance(1.5)
    network.start_server()
    started = network.time
    network.advance_until(lambda: network.vehicle.z < 0.05)
    assert min(thrusts(network, started)) > 0.5 * G
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 1.0


def test_a_filter_that_dies_in_its_descent_leaves_a_landing(network):
    network.kill("controller")
    network.advance(4.0)
    assert network.last("/in_flight_flight_status") == "landing"
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
    assert network.last("/in_flight_flight_status") == "on_ground"
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
    network.freeze("/controller")
    network.advance(0.5)
    future = network.call("/takeoff")
    network.advance_until(future.done, 4.0)
    with pytest.raises(ServiceError, match="ended by the filter: no control came"):
        future.result(0)
    until_on_ground(network)
    assert network.vehicle.touchdown_speed < 0.6
    assert "landing" in states(network)


@pytest.mark.parametrize("gap", [0.3, 1.98])
def test_takeoff_after_a_server_that_has_sent_no_reference(gap):
    """Without a height the next server sends none, either; so the controller is silent."""
    network = HoverNetwork(BARE)
    network.advance(1.5)
    network.call("/takeoff")
    network.advance(0.5)
    network.kill("server")
    network.advance(gap)
    network.start_server()
    until_on_ground(network)
    assert network.on("/control/lqr") == []
    network.take_off()


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


@pytest.mark.parametrize("takeoff", [{"duration/open_loop": 0.0}, {"takeoff/thrust": 9.0}])
def test_takeoff_after_a_flight_that_the_filter_has_ended(takeoff):
    """A takeoff without thrust above g was no takeoff for the filter: its motors stayed off."""
    network = HoverNetwork({**SERVER, **takeoff})
    network.advance(0.5)
    network.call("/emergency")
    network.advance(2.1)
    network.call("/emergency_reset")
    network.take_off()
    assert network.vehicle.z == pytest.approx(1.0, abs=0.3)


def test_a_takeoff_whose_flight_the_filter_ends_fails():
    """The clock of a slow simulation: the filter did not pass it on, and the call succeeded."""
    network = HoverNetwork(SERVER)
    network.advance(0.5)
    future = network.call("/takeoff")
    network.advance(1.1)
    assert network.last("/in_flight_flight_status") == "taking_off"
    network.kill("filter")
    status = filter_status("taking_off", FilterStatus.DOWN, reason="it was too slow")
    network.publish("/in_flight_filter_status", status, "/filter")
    network.advance_until(future.done)
    with pytest.raises(ServiceError, match="ended by the filter: it was too slow"):
        future.result(0)
