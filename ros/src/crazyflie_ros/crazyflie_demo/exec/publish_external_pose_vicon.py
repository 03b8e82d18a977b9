#!/usr/bin/env python
"""Vicon's transforms as the pose of a vehicle."""

from crazyflie_utils import run

run("crazyflie_demo.external_nodes:ExternalPoseViconNode", "publish_external_pose_vicon")
