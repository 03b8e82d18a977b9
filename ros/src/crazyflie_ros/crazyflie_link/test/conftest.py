"""Fixtures of the tests: a vehicle with scripted answers."""

import queue

import pytest
import usb
from cflib.crtp.radiodriver import RadioManager
from cflib.drivers import crazyradio
from usb_bus import PLACES, Bus

from crazyflie_link.crazyflie import Crazyflie
from crazyflie_utils.testing.fixtures import own_cache  # noqa: F401
from crazyflie_virtual.testing import EXTENDED, READ_ONLY, FakeVehicle

LIMIT = 60.0

LOG = {
    "stateEstimate.x": ("f", 1.5),
    "stateEstimate.y": ("f", -2.5),
    "pm.vbat": ("f", 3.75),
    "radio.rssi": ("B", 47),
    "pm.state": ("b", -1),
    "stateEstimateZ.quat": ("I", 0xC0000000),
    "gyro.xRaw": ("h", -1234),
    "kalman.q0": ("e", 0.5),
}

PARAMETERS = {
    "ring.effect": ("B", 6, 0),
    "pid_rate.roll_kp": ("f", 0.25, EXTENDED),
    "cpu.id0": ("I", 2**32 - 1, READ_ONLY),
    "sound.freq": ("H", 4000, 0),
    "motor.trim": ("b", -3, 0),
}


@pytest.fixture
def make_vehicle():
    """Return a function that makes vehicles, which end with the test."""
    vehicles = []

    def make(**options):
        options.setdefault("log", dict(LOG))
        options.setdefault("parameters", dict(PARAMETERS))
        vehicles.append(FakeVehicle(**options))
        return vehicles[-1]

    yield make
    for vehicle in vehicles:
        vehicle.close()


@pytest.fixture
def make_link():
    """Return a function that makes (unconnected) links, which end with the test."""
    links = []

    def make(uri, **options):
        links.append(Crazyflie(uri, **options))
        return links[-1]

    yield make
    for link in links:
        link.close()


@pytest.fixture
def vehicle(make_vehicle):
    return make_vehicle()


@pytest.fixture
def link(vehicle, make_link):
    """Return a link that is connected to ``vehicle``."""
    link = make_link(vehicle.uri)
    link.connect()
    return link


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    """Return a vehicle, a connected link and the vehicle's first parameters, for a module."""
    cache = str(tmp_path_factory.mktemp("cache"))
    with (
        FakeVehicle(log=dict(LOG), parameters=dict(PARAMETERS)) as vehicle,
        Crazyflie(vehicle.uri, cache=cache) as link,
    ):
        yield vehicle, link, dict(PARAMETERS)


@pytest.fixture
def target(shared):
    """Return the module's vehicle as if it were new."""
    vehicle, _, parameters = shared
    vehicle.parameters.update(parameters)
    vehicle.answers.clear()
    vehicle.flight.restart()
    vehicle.received.clear()
    return vehicle


@pytest.fixture
def flying(shared):
    """Return the link to the module's vehicle."""
    return shared[1]


class States:
    """The states that a link goes through, to be waited for."""

    def __init__(self):
        self._states = queue.Queue()

    def __call__(self, state, text):
        self._states.put((state, text))

    def wait_for(self, state):
        return self.wait_for_first(state)[1]

    def wait_for_first(self, *wanted):
        """Return the first state of these that comes, and its text."""
        while True:
            seen, text = self._states.get(timeout=LIMIT)
            if seen in wanted:
                return seen, text


@pytest.fixture
def states():
    return States()


@pytest.fixture
def bus(monkeypatch):
    vehicles = {place: FakeVehicle() for place in PLACES}
    bus = Bus(vehicles)
    bus.plug_in()
    monkeypatch.setattr(crazyradio, "_find_devices", bus.devices)
    monkeypatch.setattr(usb.util, "dispose_resources", lambda device: None)
    monkeypatch.setattr(RadioManager, "_radios", [])
    yield bus
    for vehicle in vehicles.values():
        vehicle.close()
