"""A vehicle's states, what it is sent and what is said of it, for the tests of safety."""

import struct
import threading

from genpy import Duration
from geometry_msgs.msg import Twist, Vector3

from crazyflie_driver.msg import Position
from crazyflie_driver.srv import LandRequest, TakeoffRequest
from crazyflie_utils.testing.peer import wait_until

ZERO = struct.pack("<fffH", 0, 0, 0, 0)
SETPOINTS_STOP = struct.pack("<BI", 0, 0)
UNLOCKED = [(3, 0)] * 100 + [(7, 1)]
"""The `commands` that open the thrust lock, and that leave a vehicle on the ground."""
READY, FLYING, HIGH_LEVEL, LOCKED = 0x20E, 0x21E, 0x31E, 0x244
"""Recorded of the firmware: on the ground, in a flight on setpoints, which is also what it reports
for 2 s after a touchdown, in one by its high-level commander, and after an emergency stop."""

LAND = LandRequest(0, 0.0, Duration(2))
TAKEOFF = TakeoffRequest(0, 1.0, Duration(2))


def is_(vehicle, state):
    """Set the state that a vehicle reports and logs; None for its own again."""
    vehicle.flight.pin(state)


def position(server):
    server.process.publish("/cf1/cmd_position", Position(z=1.0))


def stream_position(server, vehicle):
    """Fly a vehicle on positions, and forget the packets so far."""
    position(server)
    vehicle.wait_for_packets(7, 0)
    vehicle.received.clear()


def thrust(server, pwm=1000.0):
    server.process.publish("/cf1/cmd_vel", Twist(Vector3(0, 0, pwm), Vector3()))


def commands(vehicle):
    """Return the commands and setpoints that have come, as (port, channel)."""
    return [(port, channel) for port, channel, _ in list(vehicle.received) if port in (3, 7, 8)]


def begin_removing(server, vehicle):
    """Return the thread that removes a vehicle, which has been sent a landing."""
    removing = threading.Thread(target=server.remove, args=(vehicle.uri,))
    removing.start()
    assert vehicle.wait_for_packets(8, 0)[0][0] == 8
    assert commands(vehicle)[:2] == [(7, 1), (8, 0)]
    return removing


def said(server):
    """Return what the vehicle's status topic said last."""
    return server.process.published("/cf1/status")[-1].data


def wait_for_words(server, words):
    """Wait until the status topic says these words, if only for a moment, or says them already."""
    before = len(server.process.published("/cf1/status")) - 1

    def is_said():
        server.process.advance(0.1)
        news = server.process.published("/cf1/status")[max(0, before) :]
        return any(words in message.data for message in news)

    wait_until(is_said, words)
