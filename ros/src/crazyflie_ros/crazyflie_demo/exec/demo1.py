#!/usr/bin/env python
"""A tour along waypoints, for the first of two vehicles."""

from crazyflie_utils import run

run("crazyflie_demo.waypoint_node:Demo1Node", "demo")
