#!/usr/bin/env python
"""A goal that stays where it is."""

from crazyflie_demo.publish_pose_node import PublishPoseNode
from crazyflie_utils import run

run(PublishPoseNode, "pose")
