"""ROS interface of a virtual vehicle."""

from crazyflie_virtual.server import Server
from crazyflie_virtual.server_node import ServerNode
from crazyflie_virtual.settings import Settings


class VirtualCrazyflieNode(ServerNode):
    """A virtual vehicle whose options are parameters."""

    def __init__(self):
        super().__init__(Settings, Server)
