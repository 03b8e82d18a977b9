#!/usr/bin/env python
"""A flight along a trajectory of polynomials."""

from crazyflie_demo.trajectory_flight_node import TrajectoryFlightNode
from crazyflie_utils import run

run(TrajectoryFlightNode, "execute_trajectory")
