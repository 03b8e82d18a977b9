#!/usr/bin/env python
"""A keyboard in the place of a joystick."""

from crazyflie_utils import run

run("crazyflie_demo.keyboard_node:KeyboardNode", "keyboard")
