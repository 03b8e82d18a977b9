#!/usr/bin/env python
"""A keyboard that stands for a joystick."""

from crazyflie_utils import run

run("crazyflie_demo.keyboard_node:KeyboardNode", "keyboard")
