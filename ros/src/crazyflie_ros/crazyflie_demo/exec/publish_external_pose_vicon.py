#!/usr/bin/env python
"""Vicon's transforms as the pose of a vehicle."""

from crazyflie_demo.external_nodes import ExternalPoseViconNode
from crazyflie_utils import run

run(ExternalPoseViconNode, "publish_external_pose_vicon")
