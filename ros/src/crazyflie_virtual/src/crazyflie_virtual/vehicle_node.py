"""ROS interface of a virtual vehicle."""

from crazyflie_virtual.link.server import VehicleServer
from crazyflie_virtual.server_node import ServerNode
from crazyflie_virtual.settings import VehicleSettings


class VirtualCrazyflieNode(ServerNode):
    """A virtual vehicle behind a UDP port."""

    settings_type = VehicleSettings
    server_type = VehicleServer
