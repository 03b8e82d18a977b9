#!/usr/bin/env python
"""A flight by positions, cmd_position."""

from crazyflie_demo.position_flight_node import PositionFlightNode
from crazyflie_utils import run

run(PositionFlightNode, "position")
