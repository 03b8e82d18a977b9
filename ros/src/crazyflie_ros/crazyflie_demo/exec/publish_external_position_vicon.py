#!/usr/bin/env python
"""Vicon's transforms as the position of a vehicle."""

from crazyflie_demo.external_nodes import ExternalPositionViconNode
from crazyflie_utils import run

run(ExternalPositionViconNode, "publish_external_position_vicon")
