"""The geometry of base stations, measured and stored on a virtual vehicle."""

import struct

import numpy as np
import pytest
from cflib.localization import LighthouseConfigFileManager
from scipy.spatial.transform import Rotation

from crazyflie_link.testing import write_lighthouse_file
from crazyflie_tools.lighthouse import lighthouse
from crazyflie_utils.testing.peer import wait_until
from crazyflie_virtual.firmware.decks import GEOMETRIES
from crazyflie_virtual.testing import virtual_vehicle

#: Positions on the floor (m), in the order in which they are asked for; at last the origin again.
FLOOR = ((0.0, 0.0), (1.0, 0.0), (0.8, 0.6), (0.0, -0.7), (-0.6, 0.3))


class Operator:
    """A person who carries the vehicle from one position to the next, and presses Enter."""

    def __init__(self, server, monkeypatch, tmp_path, capsys):
        self.server, self.capsys = server, capsys
        self.path = tmp_path / "stations.yaml"
        self.answers = iter(())
        monkeypatch.setattr("builtins.input", self.answer)

    def answer(self, prompt):
        place = next(self.answers, "q")
        if place == "q":
            return place
        physics = self.server.vehicle.physics
        physics.hand.x, physics.hand.y = place
        goal = (*place, 0.0)
        wait_until(lambda: np.allclose(physics.position, goal, atol=1e-3), f"vehicle at {place}")
        return ""

    def run(self, *arguments, places=()):
        """Return status, output and errors of the tool, which asks for these positions."""
        self.answers = iter(places)
        uri = "udp://{}:{}".format(*self.server.address)
        status = lighthouse(["--uri", uri, "--out", str(self.path), *arguments])
        printed = self.capsys.readouterr()
        return status, printed.out, printed.err

    def fails(self, *arguments, places=()):
        """Return the error of the tool, which has written nothing."""
        before = dict(self.server.vehicle.storage.lighthouse)
        status, _, error = self.run(*arguments, places=places)
        assert status == 1
        assert error.startswith("lighthouse: ")
        assert self.server.vehicle.storage.lighthouse == before
        return error

    def write(self, geometries):
        """Write a file of geometries as the tool does."""
        LighthouseConfigFileManager.write(str(self.path), geometries)


@pytest.fixture
def operator(monkeypatch, tmp_path, capsys, own_cache):
    with virtual_vehicle(positioning="lighthouse", knows_stations=False) as (server, _):
        yield Operator(server, monkeypatch, tmp_path, capsys)


def test_the_geometry_is_measured_stored_and_checked(operator):
    assert "no geometry of a base station; expected at least one" in operator.fails("--check")
    status, printed, error = operator.run(places=(*FLOOR, "q", FLOOR[0]))
    assert (status, error) == (0, "")
    assert "residual" in printed
    geometries, calibrations, _ = LighthouseConfigFileManager.read(str(operator.path))
    assert set(geometries) == set(calibrations) == {0, 1}
    for number, geometry in geometries.items():
        *true, _ = struct.unpack("<12f?", GEOMETRIES[number])
        assert np.linalg.norm(np.array(geometry.origin) - true[:3]) < 0.005
        turn = np.array(geometry.rotation_matrix).T @ np.reshape(true[3:], (3, 3))
        assert np.degrees(Rotation.from_matrix(turn).magnitude()) < 0.5
    assert operator.server.vehicle.board.firmware.deck.active_stations == 3
    assert operator.run("--check")[::2] == (0, "")
    # One of the base stations is moved: its stored geometry is that of another place.
    geometries[1].origin = (np.array(geometries[1].origin) + (0.0, 0.1, 0.0)).tolist()
    operator.write(geometries)
    assert operator.run("--file", str(operator.path))[::2] == (0, "")
    error = operator.run("--check")[2]
    assert "expected at most 10: has a base station been moved?" in error


@pytest.mark.parametrize(
    ("occluded", "places", "reason"),
    [
        (3, FLOOR, "no base station seen; expected 2 or more"),
        (2, FLOOR, "only base station 0 seen; expected 2 or more"),
        (0, FLOOR[:1], "measured at 1 positions; expected at least 3"),
        (0, ((0.0, 0.0), (0.7, 0.0), (0.3, 0.6)), "position 2 is 0.7"),
        (0, ((0.0, 0.0), (1.0, 0.0), (0.5, 0.0)), "expected one at 0.3 m or more"),
    ],
)
def test_without_a_geometry_nothing_is_written(operator, occluded, places, reason):
    operator.server.switches.occluded = occluded
    assert reason in operator.fails(places=places)
    assert not operator.path.exists()


def test_a_file_without_a_base_station_is_not_stored(operator):
    operator.write({})
    assert "no base station; expected at least one" in operator.fails("--file", str(operator.path))


def test_a_file_with_more_stations_than_the_vehicle_has_room_for_changes_nothing(operator):
    memory = operator.server.vehicle.board.firmware.deck.memory
    write_lighthouse_file(operator.path, *range(4))
    assert operator.run("--file", str(operator.path))[::2] == (0, "")
    before = [memory.page(number) for number in memory._pages]
    write_lighthouse_file(operator.path, *range(6))
    error = operator.fails("--file", str(operator.path))
    assert "the firmware has room for 4 base stations, 0 to 3, the file has number 5" in error
    assert [memory.page(number) for number in memory._pages] == before


def test_a_file_is_not_overwritten(operator):
    operator.write({})
    assert "exists; expected a new file" in operator.fails()


def test_a_vehicle_without_the_deck_is_refused(operator, monkeypatch):
    monkeypatch.setattr(operator.server.vehicle.board.firmware.deck, "has_lighthouse", False)
    assert "no Lighthouse deck: deck.bcLighthouse4" in operator.fails("--check")
