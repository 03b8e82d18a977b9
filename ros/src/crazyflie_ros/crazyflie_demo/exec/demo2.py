#!/usr/bin/env python
"""A tour along waypoints, for the second of two vehicles."""

from crazyflie_demo.waypoint_node import Demo2Node
from crazyflie_utils import run

run(Demo2Node, "demo")
