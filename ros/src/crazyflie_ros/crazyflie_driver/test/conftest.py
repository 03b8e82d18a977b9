"""A server with a vehicle with scripted answers, and keeps what it is sent."""

import pytest
from safety_helpers import FLYING, is_, stream_position, wait_for_words

from crazyflie_driver.msg import LogBlock
from crazyflie_driver.server_node import CrazyflieServerNode
from crazyflie_driver.setpoint_gate import GateEvent
from crazyflie_driver.srv import AddCrazyflieRequest, RemoveCrazyflieRequest
from crazyflie_link.address import Address
from crazyflie_utils.testing import FakeProcess
from crazyflie_utils.testing.fixtures import own_cache  # noqa: F401
from crazyflie_virtual.testing import READ_ONLY, FakeVehicle

LIMIT = 60.0
"""The longest that a test waits for the driver, s; how soon it gives up by itself is in
crazyflie_link.link.LinkTimeouts."""

LOG = {
    "acc.x": ("f", 0.5),
    "acc.y": ("f", -0.25),
    "acc.z": ("f", 1.0),
    "gyro.x": ("f", 90.0),
    "gyro.y": ("f", -180.0),
    "gyro.z": ("f", 45.0),
    "mag.x": ("f", 0.5),
    "mag.y": ("f", -0.25),
    "mag.z": ("f", 1.0),
    "baro.temp": ("f", 25.5),
    "baro.pressure": ("f", 1013.25),
    "pm.vbat": ("f", 3.75),
    "radio.rssi": ("B", 47),
    # The value is the state of `FakeVehicle.flight`.
    "supervisor.info": ("H", 0),
    "stateEstimate.x": ("f", 1.5),
    "stateEstimate.y": ("f", -2.5),
    "stateEstimate.z": ("f", 0.75),
    "stateEstimate.yaw": ("f", 90.0),
    # w is the largest, x has the value (511 / 511) / sqrt(2): 90 degrees about x.
    "stateEstimateZ.quat": ("I", 3 << 30 | 511 << 20),
    "motor.m1": ("H", 4321),
}

PARAMETERS = {
    "ring.effect": ("B", 6, 0),
    "pid_rate.roll_kp": ("f", 0.25, 0),
    "cpu.id0": ("I", 2**32 - 1, READ_ONLY),
    "motor.trim": ("b", -3, 0),
}


class Server:
    """The driver on a fake process."""

    def __init__(self, parameters=None, recorder=None):
        self.process = FakeProcess(recorder=recorder)
        self.node = CrazyflieServerNode()
        assert self.process.launch(self.node, "/crazyflie_server", parameters)
        self.vehicles = []

    def make_vehicle(self, **options):
        options = {
            "log": dict(LOG),
            "parameters": dict(PARAMETERS),
            "clock": self.process.clock.time,
            **options,
        }
        self.vehicles.append(FakeVehicle(**options))
        return self.vehicles[-1]

    def begin_adding(self, uri, prefix="cf1", **changes):
        """Call /add_crazyflie; return its answer or a future of it."""
        request = AddCrazyflieRequest(uri=uri, tf_prefix=prefix, use_ros_time=True)
        for name, value in changes.items():
            setattr(request, name, value)
        return self.process.call("/add_crazyflie", request)

    def add(self, uri, prefix="cf1", **changes):
        """Add a vehicle, wait until it is there, and let setpoints pass as zero thrust does."""
        answer = result(self.begin_adding(uri, prefix, **changes))
        self.node._vehicles[Address.parse(uri).key].gate.handle(GateEvent.GROUND_COMMANDED)
        return answer

    def remove(self, uri):
        return result(self.process.call("/remove_crazyflie", RemoveCrazyflieRequest(uri)))

    def call(self, service, request):
        """Call a service of a vehicle, and wait for the answer."""
        return result(self.process.call(service, request))

    def close(self):
        self.node.shutdown()
        for vehicle in self.vehicles:
            vehicle.close()


def result(answer):
    return answer.result(timeout=LIMIT) if hasattr(answer, "result") else answer


@pytest.fixture
def make_server():
    """Return a function that makes a server with parameters; it ends with the test."""
    servers = []

    def make(parameters=None):
        servers.append(Server(parameters))
        return servers[-1]

    yield make
    for server in servers:
        server.close()


@pytest.fixture
def server(make_server):
    return make_server()


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """Return a server with a vehicle, cf1, for the tests of a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        server = Server()
        add_vehicle(server)
        yield server
        server.close()


def add_vehicle(server):
    """Return a vehicle that was added as cf1, with nothing that it was sent."""
    vehicle = server.make_vehicle()
    server.add(vehicle.uri)
    # The packet that ends the zero thrust after connecting.
    vehicle.wait_for_packets(7, 1)
    vehicle.received.clear()
    return vehicle


@pytest.fixture
def flying(shared):
    """Return the module's server and vehicle, as if nothing had been sent."""
    (vehicle,) = shared.vehicles
    vehicle.received.clear()
    vehicle.answers.clear()
    vehicle.deaf.clear()
    vehicle.flight.restart()
    shared.process.transport.log_records.clear()
    return shared, vehicle


@pytest.fixture
def vehicle(server):
    """Return a vehicle that has been added as cf1, without logging and parameters."""
    return add_vehicle(server)


@pytest.fixture
def hovering(server, vehicle):
    """Return a server and a vehicle that flies on positions."""
    is_(vehicle, FLYING)
    wait_for_words(server, "flying")
    stream_position(server, vehicle)
    return server, vehicle


@pytest.fixture
def log_block():
    """Return a function that makes a crazyflie_driver/LogBlock."""
    return lambda topic, period, *variables: LogBlock(topic, period, list(variables))
