#!/usr/bin/env python
"""A flight along a trajectory of polynomials.

With a file on the command line it is streamed; otherwise the parameter ~file says which one is
uploaded and flown by the vehicle itself.
"""

import sys

from crazyflie_demo.trajectory_flight_node import TrajectoryFlightNode
from crazyflie_demo.trajectory_stream_node import TrajectoryStreamNode
from crazyflie_utils import run

# Remappings and private parameters are no files.
files = [word for word in sys.argv[1:] if ":=" not in word]
if len(files) > 1:
    sys.exit("usage: execute_trajectory.py [FILE.csv]")
run(
    lambda: TrajectoryStreamNode(files[0]) if files else TrajectoryFlightNode(),
    "execute_trajectory",
)
