#!/usr/bin/env python
"""A goal that is moved by hand."""

from crazyflie_utils import run

run("crazyflie_demo.publish_pose_node:PublishPoseTeleopNode", "pose")
