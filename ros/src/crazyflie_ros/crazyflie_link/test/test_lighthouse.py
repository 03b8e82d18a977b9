"""Writing and storing the memory of base stations, on a link without a vehicle."""

import struct
from pathlib import Path
from types import SimpleNamespace

import pytest
from cflib.crazyflie.mem import CHAN_READ, MemoryElement
from cflib.crtp.crtpstack import CRTPPort

from crazyflie_link.errors import RefusedError, ValueRangeError
from crazyflie_link.localization import Lighthouse
from crazyflie_link.testing import write_lighthouse_file

CALIBRATIONS = 16  #: The page of the first calibration; those of the geometries begin at 0.
SYSTEM_TYPE = 2  #: That of the files.


class Vehicle:
    """A link to a vehicle with room for some base stations, and its parameters."""

    def __init__(self, room=4):
        self.pages, self.stored = {}, []
        self.parameters, self.answer = {"lighthouse.systemType": 1}, b"\x0b\x01"
        self._room, self.broken = room, ()
        memory = SimpleNamespace(get_mems=self._memories)
        self.cflib = SimpleNamespace(mem=memory)

    def _memories(self, kind):
        return [SimpleNamespace(id=7)] if kind == MemoryElement.TYPE_LH else []

    def values(self):
        return self.parameters

    def write(self, name, value):
        """Set a parameter; a change of the type makes the vehicle forget the stations."""
        self.parameters[name] = value
        self.pages.clear()

    def request(self, data, request):
        """Answer a request."""
        if request.port != CRTPPort.MEM:
            self.stored.append((request.port, request.channel, data))
            return self.answer
        number, address = struct.unpack_from("<BI", data)
        assert number == 7
        page, offset = divmod(address, 0x100)
        if page % CALIBRATIONS >= self._room:
            return data[:5] + b"\x05"
        if request.channel == CHAN_READ:
            return data[:5] + b"\0" + data[5:]
        if page in self.broken:
            return data[:5] + b"\x05"
        self.pages.setdefault(page, bytearray())[offset:] = data[5:]
        return data[:5] + b"\0"

    def valid(self):
        """Return the pages of stations that are valid."""
        return [page for page, data in sorted(self.pages.items()) if data[-1]]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "stations.yaml"


@pytest.mark.parametrize(("room", "mask"), [(4, 0x0F), (16, 0xFFFF)])
def test_all_stations_that_the_vehicle_has_room_for_are_written_and_stored(path, room, mask):
    vehicle = Vehicle(room)
    file = write_lighthouse_file(path, 0, 3)
    assert Lighthouse(lambda: vehicle).write_file(file, vehicle) == 2
    assert vehicle.parameters == {"lighthouse.systemType": SYSTEM_TYPE}
    assert sorted(vehicle.pages) == [*range(room), *range(CALIBRATIONS, CALIBRATIONS + room)]
    assert vehicle.valid() == [0, 3, CALIBRATIONS, CALIBRATIONS + 3]
    assert struct.unpack_from("<3f", vehicle.pages[3]) == (1.0, 2.0, 5.0)
    assert struct.unpack("<L?", vehicle.pages[CALIBRATIONS + 3][-5:]) == (1003, True)
    assert vehicle.stored == [(6, 1, struct.pack("<BHH", 11, mask, mask))]


def test_a_type_that_is_right_is_not_written(path):
    """The vehicle forgets all stations at that."""
    vehicle = Vehicle()
    vehicle.parameters["lighthouse.systemType"] = SYSTEM_TYPE
    vehicle.write = None
    Lighthouse(lambda: vehicle).write_file(write_lighthouse_file(path, 0), vehicle)
    assert vehicle.valid() == [0, CALIBRATIONS]


def test_without_room_for_a_station_of_the_file_nothing_is_stored(path):
    vehicle = Vehicle(room=2)
    with pytest.raises(ValueRangeError, match="room for 2 base stations, 0 to 1, .* has number 2"):
        Lighthouse(lambda: vehicle).write_file(write_lighthouse_file(path, 0, 2), vehicle)
    assert vehicle.stored == []
    # Nothing is written, neither is the type.
    assert vehicle.pages == {}
    assert vehicle.parameters == {"lighthouse.systemType": 1}


@pytest.mark.parametrize("page", [1, CALIBRATIONS])
def test_a_write_that_ends_on_its_way_says_what_the_vehicle_may_have(path, page):
    vehicle = Vehicle()
    vehicle.broken = (page,)
    text = "refuses it .*; the vehicle may have a part of the file's base stations: write it again"
    with pytest.raises(RefusedError, match=text):
        Lighthouse(lambda: vehicle).write_file(write_lighthouse_file(path, 0), vehicle)
    assert vehicle.stored == []


@pytest.mark.parametrize(
    ("old", "new"), [("- 1.0", "- .nan"), ("- - 0.0", "- - .inf"), ("tilt: 0.0", "tilt: .nan")]
)
def test_a_number_that_is_not_finite_changes_nothing(path, old, new):
    text = Path(write_lighthouse_file(path, 0)).read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    vehicle = Vehicle()
    with pytest.raises(ValueRangeError, match="is not finite"):
        Lighthouse(lambda: vehicle).write_file(str(path), vehicle)
    assert vehicle.pages == {}


@pytest.mark.parametrize("given", ["7", "0", "two", "[2]"])
def test_an_unknown_type_of_base_stations_changes_nothing(path, given):
    text = Path(write_lighthouse_file(path, 0)).read_text()
    path.write_text(text.replace(f"systemType: {SYSTEM_TYPE}", f"systemType: {given}"))
    vehicle = Vehicle()
    with pytest.raises(ValueRangeError, match="systemType is .*; expected 1 or 2"):
        Lighthouse(lambda: vehicle).write_file(str(path), vehicle)
    assert vehicle.pages == {}
    assert vehicle.parameters == {"lighthouse.systemType": 1}


@pytest.mark.parametrize("answer", [b"\x0b", b"\x0b\x00"])
def test_stations_that_are_not_stored_are_refused(path, answer):
    vehicle = Vehicle()
    vehicle.answer = answer
    with pytest.raises(RefusedError, match="storing"):
        Lighthouse(lambda: vehicle).write_file(write_lighthouse_file(path, 0), vehicle)


def test_a_file_written_by_hand_is_read_as_all_others(path):
    """With numbers that are texts in YAML 1.1, and with what two sweeps have in common."""
    path.write_text("""\
type: lighthouse_system_configuration
version: '1'
sweep: &sweep {phase: 1e-3, tilt: -5e-2, curve: 0, gibmag: 0, gibphase: 0, ogeemag: 0, ogeephase: 0}
geos:
  0: {origin: [1e-3, 2e0, 2], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
calibs:
  0: {uid: 1000, sweeps: [*sweep, {<<: *sweep, tilt: 0}]}
""")
    vehicle = Vehicle()
    assert Lighthouse(lambda: vehicle).write_file(str(path), vehicle) == 1
    assert struct.unpack_from("<3f", vehicle.pages[0]) == pytest.approx((0.001, 2.0, 2.0))
    tilts = struct.unpack_from("<2f20x2f", vehicle.pages[CALIBRATIONS])
    assert tilts == pytest.approx((0.001, -0.05, 0.001, 0.0))


def test_files_that_cannot_be_written_change_nothing(path):
    vehicle = Vehicle(room=16)
    for file, text in (
        (write_lighthouse_file(path, 0, 16), "base station 16; expected 0 to 15"),
        (str(path.parent / "none.yaml"), "No such file"),
    ):
        with pytest.raises(ValueRangeError, match=text):
            Lighthouse(lambda: vehicle).write_file(file, vehicle)
    assert vehicle.parameters == {"lighthouse.systemType": 1}
    assert vehicle.pages == {}


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("- 1.0", "- much", "required argument is not a float"),
        ("- 1.0\n    - 2.0\n", "- 1.0\n", "out of range"),
        ("version: '1'", "version: '2'", "version is '2'; expected 1"),
        ("type: lighthouse", "type: warehouse", "type is 'warehouse_system_configuration'"),
        ("origin:", "place:", "origin"),
        ("geos:", "geos: [", ":21: is not valid YAML"),
    ],
)
def test_a_file_with_something_else_changes_nothing(path, old, new, reason):
    text = Path(write_lighthouse_file(path, 0)).read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    vehicle = Vehicle(room=16)
    with pytest.raises(ValueRangeError, match=reason) as caught:
        Lighthouse(lambda: vehicle).write_file(str(path), vehicle)
    assert str(path) in str(caught.value)
    assert vehicle.parameters == {"lighthouse.systemType": 1}
    assert vehicle.pages == {}
