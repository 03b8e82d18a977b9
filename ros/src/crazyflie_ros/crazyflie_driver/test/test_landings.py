"""Landings that the driver begins, from the first command until the vehicle stands."""

import struct

import pytest
from genpy import Duration
from geometry_msgs.msg import Point, PointStamped
from safety_helpers import HIGH_LEVEL, TAKEOFF, is_, wait_for_words
from std_msgs.msg import Header
from test_strict_vehicle import Flight

from crazyflie_driver.msg import TrajectoryPolynomialPiece
from crazyflie_driver.srv import (
    GoToRequest,
    LandRequest,
    SpiralRequest,
    StartTrajectoryRequest,
    TakeoffRequest,
    UploadTrajectoryRequest,
)
from crazyflie_utils import ServiceError
from crazyflie_utils.testing.programs import LIMIT
from crazyflie_virtual.testing import virtual_vehicle

HEIGHT = 1.0
EMPTY = 0.03
"""A charge with which a vehicle that hovers has less than 3.0 V."""

# On a vehicle with scripted answers: the bytes of the command.


@pytest.fixture
def begin(make_server):
    """Return a function that has a vehicle at a height land for a reason; it returns how long."""

    def land(reason, height):
        server = make_server()
        vehicle = server.make_vehicle()
        vehicle.log["stateEstimate.z"] = ("f", height)
        server.add(vehicle.uri)
        server.call("/cf1/takeoff", TAKEOFF)
        server.process.advance(1.0)
        is_(vehicle, HIGH_LEVEL)
        wait_for_words(server, "flying: on high-level")
        if reason == "battery":
            vehicle.log["pm.vbat"] = ("f", 2.9)
            wait_for_words(server, "battery low")
            server.process.advance(5.0)
        else:
            server.node.prepare_shutdown()
        wait_for_words(server, "battery critical" if reason == "battery" else "")
        command = vehicle.wait_for_packets(8, 0, 2)[1]
        assert command[0] == 8
        return struct.unpack_from("<f", command, len(command) - 4)[0]

    return land


@pytest.mark.parametrize(
    ("reason", "height", "duration"),
    [
        ("shutdown", 0.75, 3.0),
        ("shutdown", 3.0, 6.0),
        ("shutdown", 20.0, 7.0),
        ("battery", 0.75, 3.0),
        ("battery", 2.0, 4.0),
        ("battery", 20.0, 5.0),
    ],
)
def test_the_duration_follows_the_height(begin, reason, height, duration):
    assert begin(reason, height) == pytest.approx(duration)


# On the virtual vehicle, in real time.


class Truth(Flight):
    """A flight whose true motion is kept."""

    def __init__(self, server, virtual, uri):
        super().__init__(server, virtual, uri)
        self.truth = []
        self.is_empty = False

    def run(self, duration, height=None, until=lambda: False):
        def look():
            if self.is_empty:
                # It does not end the flight by itself.
                self.virtual.vehicle.battery.charge = EMPTY
            seen = self.virtual.observe()
            self.truth.append((seen.position[2], seen.velocity[2]))
            return until()

        super().run(duration, height, look)

    @property
    def height(self):
        return self.virtual.observe().position[2]

    @property
    def motors_run(self):
        return any(self.virtual.vehicle.board.firmware.stabilizer.commands)

    def take_off(self):
        self.server.call("/cf1/takeoff", TakeoffRequest(0, HEIGHT, Duration(1)))
        self.run(LIMIT, until=lambda: self.heights and self.heights[-1] > 0.9 * HEIGHT)
        self.run(0.5)

    def drain(self):
        self.is_empty = True
        self.run(LIMIT, until=lambda: "critical" in self.said())

    def said(self):
        return self.server.process.published("/cf1/status")[-1].data

    def touches_down(self):
        """Land the vehicle; return the speed of the touchdown, m/s."""
        self.truth.clear()
        self.run(LIMIT, until=lambda: self.height < 0.02 and not self.motors_run)
        assert self.height < 0.02
        return max(-speed for height, speed in self.truth if height < 0.1)


@pytest.fixture
def weak(make_server):
    """Return a flight whose battery is critical at once below its limit."""
    server = make_server({"battery/critical_time": 0.3})
    with virtual_vehicle() as (virtual, uri):
        yield Truth(server, virtual, uri)


MOVES = {
    "go_to": GoToRequest(goal=Point(1.0, 0.0, HEIGHT), duration=Duration(2)),
    "go_to_linear": GoToRequest(goal=Point(1.0, 0.0, HEIGHT), duration=Duration(2)),
    "spiral": SpiralRequest(angle=1.0, initialRadius=0.5, finalRadius=0.5, duration=Duration(2)),
}


def test_nothing_moves_a_vehicle_whose_battery_is_critical(weak):
    weak.take_off()
    weak.drain()
    for name, request in MOVES.items():
        with pytest.raises(ServiceError, match=rf"no {name}: battery critical: \d\.\d\d V"):
            weak.server.call(f"/cf1/{name}", request)
    with pytest.raises(ServiceError, match="of all vehicles|battery critical"):
        weak.server.call(
            "/crazyflie_server/all/go_to",
            GoToRequest(relative=True, goal=Point(1.0, 0.0, 0.0), duration=Duration(2)),
        )
    assert weak.touches_down() < 1.0
    assert abs(weak.virtual.observe().position[0]) < 0.1


def test_no_trajectory_is_started_while_the_battery_is_critical(weak):
    axes = [[0.0, 1.0], [0.0], [0.0], [0.0]]
    piece = TrajectoryPolynomialPiece(*axes, Duration(2))
    weak.server.call("/cf1/upload_trajectory", UploadTrajectoryRequest(3, 0, [piece]))
    weak.take_off()
    weak.drain()
    with pytest.raises(ServiceError, match=r"no start_trajectory: battery critical: \d\.\d\d V"):
        weak.server.call("/cf1/start_trajectory", StartTrajectoryRequest(0, 3, 1.0, True, False))
    assert weak.touches_down() < 1.0
    assert abs(weak.virtual.observe().position[0]) < 0.1


def test_a_landing_for_the_battery_that_something_else_ended_is_begun_again(weak):
    weak.take_off()
    weak.drain()
    weak.run(LIMIT, until=lambda: weak.height < 0.8 * HEIGHT)
    firmware = weak.virtual.vehicle.board.firmware
    # Of another client.
    firmware.planner.go_to(firmware.time, False, False, 0.0, 0.0, 0.5, 0.0, 1.0)
    assert weak.touches_down() < 1.0


def test_a_flight_on_setpoints_is_landed_as_well(weak):
    weak.climb()
    weak.is_empty = True
    weak.truth.clear()
    # They go on.
    weak.run(LIMIT, HEIGHT, until=lambda: weak.height < 0.02 and not weak.motors_run)
    assert weak.height < 0.02
    weak.run(3.0, HEIGHT)
    assert not weak.motors_run
    assert max(-speed for height, speed in weak.truth if height < 0.1) < 1.0


class Beside(Truth):
    """A flight whose estimate has its origin on a table, above the floor that it started from."""

    TABLE = 0.75

    def wait(self, duration):
        x, y, z = self.virtual.observe().position
        self.server.process.publish(
            "/cf1/external_position", PointStamped(Header(), Point(x, y, z - self.TABLE))
        )
        super().wait(duration)


@pytest.fixture
def beside(server):
    """Return a flight next to the table."""
    with virtual_vehicle(positioning="none") as (virtual, uri):
        flight = Beside(server, virtual, uri)
        flight.run(3.0)
        assert flight.heights[-1] == pytest.approx(-Beside.TABLE, abs=0.02)
        flight.take_off()
        yield flight


def land(flight):
    flight.server.call("/cf1/land", LandRequest(0, 0.0, Duration(2)))


def test_a_landing_beside_the_table_goes_down_to_the_floor(beside):
    beside.server.node.prepare_shutdown()
    assert beside.touches_down() < 1.0


def test_the_service_lands_beside_the_table_as_well(beside):
    land(beside)
    assert beside.touches_down() < 1.0


def test_a_landing_by_the_service_that_a_go_to_ends_is_over(beside):
    land(beside)
    beside.run(0.5)
    # In the height of the table, where a landing would go on.
    place = Point(0.0, 0.0, 0.1)
    beside.server.call("/cf1/go_to", GoToRequest(goal=place, duration=Duration(1)))
    beside.run(4.0)
    assert beside.height == pytest.approx(Beside.TABLE + 0.1, abs=0.1)
    assert beside.motors_run


def test_a_landing_by_the_service_that_setpoints_end_is_over(beside):
    land(beside)
    beside.run(1.0)
    setpoints = beside.server.node._vehicles[beside.uri].setpoints
    count = setpoints.ignored
    beside.run(4.0, 0.1)
    # Right after a command of the driver's some would be.
    assert setpoints.ignored == count
    assert beside.height == pytest.approx(Beside.TABLE + 0.1, abs=0.1)
    assert beside.motors_run
