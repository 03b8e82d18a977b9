#!/usr/bin/env python
"""Poses of VRPN as the position of a vehicle."""

from crazyflie_demo.external_nodes import ExternalPositionVrpnNode
from crazyflie_utils import run

run(ExternalPositionVrpnNode, "publish_external_position_vrpn")
