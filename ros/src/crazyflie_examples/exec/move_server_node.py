#!/usr/bin/env python
"""A service that sends the vehicle from point to point."""

from crazyflie_utils import run

run("crazyflie_examples.move_server_node:MoveServerNode", "move_server")
