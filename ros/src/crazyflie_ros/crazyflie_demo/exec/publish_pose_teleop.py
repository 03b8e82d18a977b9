#!/usr/bin/env python
"""A goal that is moved by hand."""

from crazyflie_demo.publish_pose_node import PublishPoseTeleopNode
from crazyflie_utils import run

run(PublishPoseTeleopNode, "pose")
