#!/usr/bin/env python
"""A keyboard that stands for a joystick."""

from crazyflie_demo.keyboard_node import KeyboardNode
from crazyflie_utils import run

run(KeyboardNode, "keyboard")
