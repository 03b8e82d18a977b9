#!/usr/bin/env python
"""A joystick's buttons, for the vehicle in whose namespace this node is."""

from crazyflie_utils import run

run("crazyflie_demo.joystick_controller_node:JoystickControllerNode", "joystick_controller")
