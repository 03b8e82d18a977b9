#!/usr/bin/env python
"""Poses of VRPN as the position of a vehicle."""

from crazyflie_utils import run

run("crazyflie_demo.external_nodes:ExternalPositionVrpnNode", "publish_external_position_vrpn")
