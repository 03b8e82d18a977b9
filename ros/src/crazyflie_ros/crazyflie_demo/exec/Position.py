#!/usr/bin/env python
"""A flight by positions, cmd_position."""

from crazyflie_utils import run

run("crazyflie_demo.position_flight_node:PositionFlightNode", "position")
