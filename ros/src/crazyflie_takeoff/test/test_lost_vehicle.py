"""A flight whose vehicle cannot fly any more: it is over, and what is there next does not leap."""

import pytest
from flight_words import thrusts
from std_msgs.msg import Bool
from takeoff_helpers import SERVER, HoverNetwork

from crazyflie_msgs.msg import VehicleStatus
from crazyflie_takeoff.guards import MAX_FAULT_TIME
from crazyflie_takeoff.vehicle_facts import MAX_FACT_AGE
from crazyflie_utils.node import Node
from crazyflie_utils.refusal import ServiceError

READY = VehicleStatus.ARMED | VehicleStatus.CAN_FLY
DRIVEN = {"topics/connected": "/cf1/connected"}


class DriverNode(Node):
    """What a driver repeats once a second."""

    def __init__(self):
        super().__init__()
        self.is_connected = True
        self.status = {"supervisor": READY, "has_supervisor": True}

    def load_parameters(self, handle):
        pass

    def register_callbacks(self, handle):
        self._connected = handle.publisher("/cf1/connected", Bool, latch=True)
        self._status = handle.publisher("/cf1/vehicle_status", VehicleStatus, latch=True)
        handle.timer(1.0, self.tell)
        self.tell()

    def tell(self, **status):
        """Publish; ``status`` has fields that have changed."""
        self.status.update(status)
        self._connected.publish(Bool(self.is_connected))
        self._status.publish(VehicleStatus(**self.status))


@pytest.fixture
def network():
    """Return a vehicle in flight, with its driver."""
    network = HoverNetwork({**SERVER, **DRIVEN}, DRIVEN)
    network.driver = network.start("driver", DriverNode())
    network.take_off()
    return network


def disconnect(network):
    network.driver.is_connected = False
    network.driver.tell()


def kill_driver(network):
    network.kill("driver")


def lock(network):
    network.driver.tell(supervisor=VehicleStatus.LOCKED)


def stop_by_emergency(network):
    network.driver.tell(is_emergency=True)


def disarm(network):
    network.driver.tell(supervisor=VehicleStatus.CAN_BE_ARMED)


def restart(network):
    """Change the battery, so quickly that a lost link alone does not end the flight."""
    network.driver.tell(supervisor=READY | VehicleStatus.FLYING)
    network.advance(0.5)
    network.driver.tell(has_supervisor=False)
    network.advance(0.5)
    network.driver.tell(supervisor=READY, has_supervisor=True)


def rest(network):
    """Let the vehicle lie on the ground: its motors do not obey."""
    network.vehicle.__init__()
    network.vehicle.command = lambda thrust: None


LOSSES = [disconnect, kill_driver, lock, stop_by_emergency, disarm, restart]


@pytest.mark.parametrize("lose", LOSSES)
def test_the_flight_of_a_vehicle_that_cannot_fly_is_over(network, lose):
    lose(network)
    rest(network)
    network.advance(MAX_FAULT_TIME + MAX_FACT_AGE + 0.3)
    assert network.last("/in_flight_flight_status") == "on_ground"
    assert len(network.on("/in_flight")) == 2
    over = network.time
    network.advance(20.0)
    assert set(thrusts(network, over)) == {0.0}


@pytest.mark.parametrize("lose", LOSSES)
@pytest.mark.parametrize("missing", ["server", "filter"])
def test_either_of_server_and_filter_ends_it_without_the_other(lose, missing):
    """The other one may be of another implementation, which does not read what the driver says."""
    own = {"server": DRIVEN, "filter": DRIVEN, missing: {}}
    network = HoverNetwork({**SERVER, **own["server"]}, own["filter"])
    network.driver = network.start("driver", DriverNode())
    network.take_off()
    lose(network)
    rest(network)
    network.advance(MAX_FAULT_TIME + MAX_FACT_AGE + 0.3)
    over = network.time
    network.advance(20.0)
    assert set(thrusts(network, over)) == {0.0}


def test_a_vehicle_that_is_there_again_does_not_leap_and_takes_off_when_it_is_called(network):
    stop_by_emergency(network)
    rest(network)
    network.advance(MAX_FAULT_TIME + 0.3)
    over = network.time
    assert "the vehicle was stopped by emergency" in network.last("/in_flight_status")
    with pytest.raises(ServiceError, match="stopped by emergency; remove it, restart it"):
        network.call("/takeoff")
    del network.vehicle.command
    network.driver.tell(is_emergency=False)
    network.advance(10.0)
    assert set(thrusts(network, over)) == {0.0}
    assert network.vehicle.z == 0.0
    network.take_off()
    assert network.vehicle.z == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("lose", [disconnect, kill_driver])
def test_a_short_loss_ends_no_flight(network, lose):
    lose(network)
    network.advance(MAX_FAULT_TIME - 0.2)
    if lose is kill_driver:
        network.start("driver", DriverNode())
    else:
        network.driver.is_connected = True
        network.driver.tell()
    network.advance(5.0)
    assert network.last("/in_flight_flight_status") == "flying"
    assert network.vehicle.z == pytest.approx(1.0, abs=0.05)


def test_a_driver_that_never_spoke_ends_no_flight():
    network = HoverNetwork(SERVER, DRIVEN)
    network.take_off()
    network.advance(10.0)
    assert network.last("/in_flight_flight_status") == "flying"


@pytest.mark.parametrize("flying", [VehicleStatus.FLYING, 0])
def test_takeoffs_that_follow_each_other_are_not_ended(flying):
    """Between them the vehicle says that it does not fly; a driver might never say that it does."""
    network = HoverNetwork({**SERVER, **DRIVEN}, DRIVEN)
    network.driver = network.start("driver", DriverNode())
    for _ in range(2):
        network.take_off()
        network.driver.tell(supervisor=READY | flying)
        network.advance(5.0)
        assert network.last("/in_flight_flight_status") == "flying"
        landing = network.call("/land")
        network.advance(10.0)
        landing.result(0)
        network.driver.tell(supervisor=READY)
        network.advance(5.0)


@pytest.mark.parametrize("moment", [0.3, 3.0])
def test_a_takeoff_of_a_vehicle_that_is_lost_fails(moment):
    network = HoverNetwork({**SERVER, **DRIVEN}, DRIVEN)
    network.driver = network.start("driver", DriverNode())
    network.advance(0.5)
    takeoff = network.call("/takeoff")
    network.advance(moment)
    lock(network)
    network.advance(MAX_FAULT_TIME + 0.2)
    with pytest.raises(ServiceError, match="the flight was ended.*its state is: locked"):
        takeoff.result(0)
    assert network.last("/in_flight_flight_status") == "on_ground"
