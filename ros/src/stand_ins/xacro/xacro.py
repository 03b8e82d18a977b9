#!/usr/bin/python3
"""For $(find xacro)/xacro.py of launch files: rosrun knows the Python that is needed."""

import os
import sys

os.execvp("rosrun", ["rosrun", "xacro", "expand", *sys.argv[1:]])
