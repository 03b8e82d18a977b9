#!/bin/sh
# For $(find xacro)/xacro.py of launch files; rosrun knows the Python that is needed.
exec rosrun xacro expand "$@"
