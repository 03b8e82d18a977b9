#!/usr/bin/env python
"""A service that sends the vehicle from point to point."""

from crazyflie_examples.move_server_node import MoveServerNode
from crazyflie_utils import run

run(MoveServerNode, "move_server")
