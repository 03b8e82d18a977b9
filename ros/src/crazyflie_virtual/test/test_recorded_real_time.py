"""A part of the recorded scenarios against the clock: cflib flies a vehicle in its own process.

The other files advance the time of the vehicle themselves, and cannot see it stop.
"""

import math
import subprocess
import sys
import time
from itertools import pairwise

import pytest
from cflib.crazyflie.log import LogConfig
from flight_recorder import HEIGHT, MOMENT, NEAR
from recording import recorded
from virtual_client import Client

from crazyflie_utils.testing.programs import LIMIT, free_port, running, wait_until

PAUSE = 0.1
"""s. It was 0.03 on a machine with three times the load that it has processors for; and 0.13 to
0.27 where a module was imported in the flight."""

VARIABLES = ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "stabilizer.yaw")


class Flight:
    """A vehicle that was started a moment ago, and where it has been."""

    def __init__(self, client):
        self._client = client
        self._commander = client.cf.high_level_commander
        self.rows = []  #: Moment of arrival (s), x, y, z (m), yaw (deg).
        log = LogConfig("pose", 10)
        for name in VARIABLES:
            log.add_variable(name, "float")
        log.data_received_cb.add_callback(self._note)
        client.cf.log.add_config(log)
        log.start()
        wait_until(lambda: self.rows, "the log", LIMIT)
        self.begin()

    def _note(self, stamp, data, log):
        self.rows.append((time.monotonic(), *(data[name] for name in VARIABLES)))

    def begin(self):
        """Count times from now on."""
        self.began = time.monotonic()

    def wait_until(self, moment):
        """Wait for what is logged until a time, s."""
        end = self.began + moment
        wait_until(lambda: self.rows[-1][0] > end, f"the log at {moment:g} s", LIMIT)

    def command(self, method, *arguments, **options):
        """Give a high-level command, and count times from then on."""
        self.begin()
        getattr(self._commander, method)(*arguments, **options)

    def climb(self, height):
        """Take off; the scenarios go on a second after the climb."""
        self.command("takeoff", height, 2.0)
        self.wait_until(3.0)

    def check_for_pauses(self):
        """Look whether the log, of 100 Hz, has stopped at any time."""
        assert max(b[0] - a[0] for a, b in pairwise(self.rows)) < PAUSE

    def near(self, moment, expected):
        """Return the position about a time that is nearest to the expected one."""
        self.wait_until(moment + MOMENT)
        places = [row[1:4] for row in self.rows if abs(row[0] - self.began - moment) < MOMENT]
        return min(places, key=lambda place: math.dist(place, expected))

    def follow(self, track):
        """Compare with a recorded track."""
        for moment, *place, _ in track:
            assert self.near(moment, place) == pytest.approx(place, abs=NEAR), moment


@pytest.fixture
def flight():
    port = free_port()
    program = (sys.executable, "-m", "crazyflie_virtual", "--port", port, "--observer-port", 0)
    client = Client(f"udp://127.0.0.1:{port}")
    with running(*program, stdout=subprocess.PIPE) as process:
        # Its address: it can be reached from then on.
        assert process.stdout.readline()
        client.open().wait_for("fully_connected")
        yield Flight(client)
        client.close()


def test_takeoff(flight):
    flight.command("takeoff", 0.5, 2.0)
    for k, height in enumerate(recorded("takeoff_land")["track_z"]):
        moment = 0.5 + 0.5 * k
        expected = (0.0, 0.0, height)
        assert flight.near(moment, expected)[2] == pytest.approx(height, abs=HEIGHT), moment
    flight.check_for_pauses()


def test_go_to(flight):
    flight.climb(0.5)
    flight.command("go_to", 1.0, 0.0, 0.7, 1.57, 3.0)
    flight.follow(recorded("go_to")["abs_track"])
    flight.command("go_to", -0.5, 0.5, 0.0, 0.5, 2.0, relative=True)
    flight.follow(recorded("go_to")["rel_track"])
    flight.check_for_pauses()


def test_spiral(flight):
    flight.climb(0.6)
    flight.command("spiral", math.pi / 2.0, 0.5, 0.5, 0.2, 3.0)
    flight.follow(recorded("spiral")["track"])
    flight.check_for_pauses()
