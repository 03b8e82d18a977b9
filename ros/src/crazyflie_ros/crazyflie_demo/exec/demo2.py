#!/usr/bin/env python
"""A tour along waypoints, for the second of two vehicles."""

from crazyflie_utils import run

run("crazyflie_demo.waypoint_node:Demo2Node", "demo")
