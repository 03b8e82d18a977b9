#!/usr/bin/env python
"""A tour along waypoints."""

from crazyflie_utils import run

run("crazyflie_demo.waypoint_node:DemoNode", "demo")
