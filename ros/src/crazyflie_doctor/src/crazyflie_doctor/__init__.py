"""What is wrong with an installation and with a running graph, and what to do about it.

The checks (`installation`, `graph`, `timing`) are functions from data to findings and need
no ROS; `computer`, `running_graph` and `recorder` gather the data.
"""
