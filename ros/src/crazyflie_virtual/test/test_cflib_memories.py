"""Memories of decks and vehicle through cflib, as its users' programs read and write them."""

import threading

import pytest
from cflib.crazyflie.mem import LighthouseBsGeometry, LighthouseMemHelper, MemoryElement, OWElement
from cflib.crazyflie.mem.deck_memory import SyncDeckMemoryManager
from cflib.crazyflie.syncCrazyflie import SyncCrazyflie
from cflib.localization import LighthouseConfigWriter
from cflib.utils.multiranger import Multiranger
from virtual_client import LIMIT, connected_vehicle

from crazyflie_utils.testing.programs import wait_until
from crazyflie_virtual.memory import LighthouseMemory


@pytest.fixture(scope="module")
def connected():
    """Return a vehicle and a client."""
    with connected_vehicle(multiranger=True) as (vehicle, client):
        yield vehicle, client.cf


class Done(threading.Event):
    """Called back, with what."""

    def __call__(self, *arguments):
        self.arguments = arguments
        self.set()

    def wait_for(self):
        assert self.wait(LIMIT)
        return self.arguments


def test_one_wire_memories_are_read_written_and_erased(connected):
    _, cf = connected
    ring, *others = cf.mem.get_mems(MemoryElement.TYPE_1W)
    assert ring.valid
    assert (ring.vid, ring.pid) == (0xBC, 0x01)
    names = [memory.elements["Board name"] for memory in (ring, *others)]
    assert names == ["bcLedRing", "bcFlow2", "bcLighthouse4", "bcMultiranger"]
    ring.vid = ring.pid = 0
    ring.elements[OWElement.element_mapping[1]] = "Hello deck"
    written, updated = Done(), Done()
    ring.write_data(written)
    written.wait_for()
    ring.elements = {}
    ring.update(updated)
    updated.wait_for()
    assert ring.valid
    assert ring.elements["Board name"] == "Hello deck"
    erased, updated = Done(), Done()
    ring.erase(erased)
    erased.wait_for()
    ring.update(updated)
    updated.wait_for()
    assert not ring.valid


def test_configuration_memory_is_read_and_written(connected):
    _, cf = connected
    (eeprom,) = cf.mem.get_mems(MemoryElement.TYPE_I2C)
    for expected, new in ((80, 60), (60, 80)):
        updated, written = Done(), Done()
        eeprom.update(updated)
        updated.wait_for()
        assert eeprom.valid
        assert eeprom.elements["radio_channel"] == expected
        assert eeprom.elements["radio_address"] == 0xE7E7E7E7E7
        eeprom.elements["radio_channel"] = new
        eeprom.write_data(written)
        written.wait_for()


def test_led_memories_are_written(connected):
    vehicle, cf = connected
    for memory_type in (MemoryElement.TYPE_DRIVER_LED, MemoryElement.TYPE_DRIVER_LEDTIMING):
        (memory,) = cf.mem.get_mems(memory_type)
        if memory_type == MemoryElement.TYPE_DRIVER_LED:
            memory.leds[0].set(r=255, g=0, b=0)
        else:
            memory.add(25, {"r": 0, "g": 100, "b": 0})
        written = Done()
        memory.write_data(written)
        written.wait_for()
    assert vehicle.board is not None


def test_lighthouse_geometry_is_stored(connected):
    _, cf = connected
    geometry = LighthouseBsGeometry()
    geometry.origin = [1.0, 2.0, 3.0]
    geometry.rotation_matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    geometry.valid = True
    stored, read = Done(), Done()
    writer = LighthouseConfigWriter(cf, nr_of_base_stations=LighthouseMemory.STATIONS)
    writer.write_and_store_config(stored, geos={1: geometry})
    assert stored.wait_for() == (True,)
    LighthouseMemHelper(cf).read_all_geos(read)
    (geometries,) = read.wait_for()
    assert geometries[1].origin == [1.0, 2.0, 3.0]
    assert geometries[1].valid
    assert not geometries[0].valid


def test_no_deck_has_firmware(connected):
    _, cf = connected
    (manager,) = cf.mem.get_mems(MemoryElement.TYPE_DECK_MEMORY)
    assert SyncDeckMemoryManager(manager).query_decks() == {}


def test_multiranger(connected):
    _, cf = connected
    client = SyncCrazyflie("", cf=cf)
    ranger = Multiranger(client, rate_ms=20)
    ranger.start()
    wait_until(lambda: ranger.down == 0.0)
    assert (ranger.front, ranger.back, ranger.left, ranger.right, ranger.up) == (None,) * 5
    ranger.stop()
