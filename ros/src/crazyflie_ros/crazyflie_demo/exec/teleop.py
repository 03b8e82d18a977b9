#!/usr/bin/env python
"""Flight by hand."""

from crazyflie_utils import run

run("crazyflie_demo.cmd_vel_teleop_node:CmdVelTeleopNode", "teleop")
