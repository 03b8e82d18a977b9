#!/usr/bin/env python
"""A tour along waypoints, for the first of two vehicles."""

from crazyflie_demo.waypoint_node import Demo1Node
from crazyflie_utils import run

run(Demo1Node, "demo")
