#!/usr/bin/env python
"""Vicon's transforms as the position of a vehicle."""

from crazyflie_utils import run

run("crazyflie_demo.external_nodes:ExternalPositionViconNode", "publish_external_position_vicon")
