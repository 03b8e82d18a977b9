"""Broadcasts to twenty virtual vehicles on the model of a radio channel, in simulated time."""

import struct

import pytest

from crazyflie_link.broadcast import REPEAT_PERIOD, REPEATS
from crazyflie_link.localization import pack
from crazyflie_virtual.radio import RadioChannel, RadioSwarm

VEHICLES = 20
TAKEOFF = bytes([8 << 4]) + struct.pack("<BBff?f", 7, 0, 1.0, 0.0, True, 2.0)


@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_the_skew_of_a_takeoff(loss):
    swarm = RadioSwarm(VEHICLES, RadioChannel(), loss)
    begun = {}
    for repeat in range(REPEATS):
        received = swarm.broadcast(0.1 + REPEAT_PERIOD * repeat, TAKEOFF)
        for number, (time, answers) in received.items():
            # The vehicle carries out the first one, and refuses the others.
            assert [answer[-1] for answer in answers] == [number in begun]
            begun.setdefault(number, time)
    assert len(begun) == VEHICLES
    assert max(begun.values()) - min(begun.values()) < 0.005
    assert (max(begun.values()) > min(begun.values())) == (loss > 0.0)


def test_each_vehicle_takes_its_own_pose_out_of_the_packets():
    swarm = RadioSwarm(VEHICLES, RadioChannel(has_setup_requests=False))
    frames = 5
    for frame in range(frames):
        poses = {
            number: ((0.001 * frame, 1.0 * number, 0.5), (0.0, 0.0, 0.0, 1.0))
            for number in range(1, VEHICLES + 1)
        }
        for each in pack(poses):
            swarm.broadcast(0.01 * frame, bytes([each.port << 4 | each.channel, *each.data]))
        # All of a frame before the next one.
        assert swarm.channel.free < 0.01 * (frame + 1)
    for number, vehicle in enumerate(swarm.vehicles, start=1):
        firmware = vehicle.board.firmware
        localization = firmware.localization
        assert (localization.x, localization.y, localization.z) == (0.004, 1.0 * number, 0.5)
        assert firmware.link_statistics.received_broadcasts == 10 * frames
        assert firmware.link_statistics.received == 0
