"""What is wrong with an installation and with a running graph, and what to do about it.

The checks (`installation`, `graph`, `motion`) are functions from data to findings and need
no ROS; `look` and `listen` gather the data.
"""
