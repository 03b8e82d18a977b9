"""Checks of an installation and of a running graph, each with a remedy.

The checks (`installation`, `graph`, `timing`) are functions from data to findings and need
no ROS; `computer` and `running_graph` gather the data.
"""
