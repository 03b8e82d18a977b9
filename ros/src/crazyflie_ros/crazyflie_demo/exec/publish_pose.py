#!/usr/bin/env python
"""A goal that stays where it is."""

from crazyflie_utils import run

run("crazyflie_demo.publish_pose_node:PublishPoseNode", "pose")
