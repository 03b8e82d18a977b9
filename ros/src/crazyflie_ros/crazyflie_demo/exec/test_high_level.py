#!/usr/bin/env python
"""A test flight by high-level commands."""

from crazyflie_demo.high_level_flight_node import HighLevelFlightNode
from crazyflie_utils import run

run(HighLevelFlightNode, "test_high_level")
