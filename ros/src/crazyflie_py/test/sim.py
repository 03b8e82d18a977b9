"""Swarms of --sim for tests."""

import numpy as np

from crazyflie_py import Crazyswarm

PAIR = """
crazyflies:
- {channel: 80, id: 1, initialPosition: [1.0, 0.0, 0.0], type: default}
- {channel: 80, id: 2, initialPosition: [-1.0, 0.0, 0.0], type: default}
"""


def simulated(args="", fleet=PAIR):
    """Return a swarm that draws nothing."""
    return Crazyswarm(crazyflies_yaml=fleet, args=f"--sim --vis null {args}")


def hovering(args="", fleet=PAIR, height=1.0):
    """Return a swarm at a height, m."""
    swarm = simulated(args, fleet)
    swarm.allcfs.takeoff(targetHeight=height, duration=2.0)
    swarm.timeHelper.sleep(2.0)
    return swarm


def positions(swarm):
    """Return the positions, shape (n, 3)."""
    return np.array([cf.position() for cf in swarm.allcfs.crazyflies])


def starts(swarm):
    """Return the positions before takeoff, shape (n, 3)."""
    return np.array([cf.initialPosition for cf in swarm.allcfs.crazyflies])
