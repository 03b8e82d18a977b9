"""Support for tests: a process without ROS; pytest files and a peer of nodes for rostests."""

from crazyflie_utils.testing.fake_graph import FakeGraph
from crazyflie_utils.testing.fake_process import FakeProcess

__all__ = ["FakeGraph", "FakeProcess"]
