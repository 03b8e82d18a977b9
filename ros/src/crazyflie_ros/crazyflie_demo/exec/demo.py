#!/usr/bin/env python
"""A tour along waypoints."""

from crazyflie_demo.waypoint_node import DemoNode
from crazyflie_utils import run

run(DemoNode, "demo")
