#!/usr/bin/env python
"""Print the load of a radio channel, and the skew of vehicles that begin a broadcast command.

Run it in a shell that has sourced the workspace:

    python3 ros/src/crazyflie_ros/crazyflie_link/bench/radio_channel.py

Both are calculated in simulated time with the model of a channel in crazyflie_virtual.radio,
which names its sources; the skew with virtual vehicles that miss some of the packets. Nothing is
asserted.
"""

import argparse
import struct

from crazyflie_link.broadcast import REPEAT_PERIOD, REPEATS
from crazyflie_link.localization import POSES_PER_PACKET, POSITIONS_PER_PACKET
from crazyflie_virtual.radio import Load, RadioChannel, RadioSwarm, usage

TAKEOFF = bytes([8 << 4]) + struct.pack("<BBff?f", 7, 0, 1.0, 0.0, True, 2.0)
#: Vehicles per packet, and bytes of it with its header.
FRAMES = {"poses": (POSES_PER_PACKET, 25), "positions": (POSITIONS_PER_PACKET, 29)}

LOSSES = (0.0, 0.1, 0.3)
SEEDS = 5


def main() -> None:
    """Measure by the command line, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--vehicles", type=int, default=20, help="number of vehicles on the channel (20)"
    )
    parser.add_argument("--rate", type=float, default=100.0, help="rate of frames, Hz (100)")
    parser.add_argument(
        "--polls", type=float, default=20.0, help="rate of packets to each vehicle, Hz (20)"
    )
    options = parser.parse_args()
    n = options.vehicles
    print(f"{n} vehicles, frames at {options.rate:g} Hz, packets to each at {options.polls:g} Hz")
    for has_setup, dongle in ((False, "settings in the packet"), (True, "setup requests")):
        for name, (each, size) in FRAMES.items():
            frame = (size,) * -(-n // each)
            load = Load(n, options.rate, frame, options.polls)
            found = usage(load, RadioChannel(has_setup))
            print(
                f"{dongle:22s} {name:9s} {len(frame):2d} packets, {100 * found.share:4.0f} % of "
                f"the channel, a frame after {1e3 * found.frame_delay:5.1f} ms at most"
            )
    for loss in LOSSES:
        most = max(_skew(n, loss, seed) for seed in range(SEEDS))
        print(f"takeoff, {100 * loss:2.0f} % lost: skew {1e3 * most:.1f} ms at most")


def _skew(vehicles, loss, seed):
    swarm = RadioSwarm(vehicles, RadioChannel(), loss, seed)
    begun: dict[int, float] = {}
    for repeat in range(REPEATS):
        for number, (time, _) in swarm.broadcast(REPEAT_PERIOD * repeat, TAKEOFF).items():
            begun.setdefault(number, time)
    return max(begun.values()) - min(begun.values())


if __name__ == "__main__":
    main()
