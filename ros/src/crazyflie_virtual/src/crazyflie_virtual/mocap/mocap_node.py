"""ROS interface of the virtual motion capture system."""

from crazyflie_virtual.mocap.server import MocapServer
from crazyflie_virtual.mocap.settings import MocapSettings
from crazyflie_virtual.server_node import ServerNode


class VirtualMocapNode(ServerNode):
    """A NatNet server."""

    settings_type = MocapSettings
    server_type = MocapServer
