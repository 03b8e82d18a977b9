#!/usr/bin/env python
"""A test flight by high-level commands."""

from crazyflie_utils import run

run("crazyflie_demo.high_level_flight_node:HighLevelFlightNode", "test_high_level")
