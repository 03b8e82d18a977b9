#!/usr/bin/env python
"""Flight by hand."""

from crazyflie_demo.cmd_vel_teleop_node import CmdVelTeleopNode
from crazyflie_utils import run

run(CmdVelTeleopNode, "teleop")
