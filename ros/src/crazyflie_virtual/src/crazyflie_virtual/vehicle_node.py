"""ROS interface of a virtual vehicle."""

from functools import partial
from typing import cast

from typing_extensions import override

from crazyflie_utils import NodeHandle, TransformError
from crazyflie_virtual.link.server import VehicleServer
from crazyflie_virtual.server_node import ServerNode
from crazyflie_virtual.settings import VehicleSettings

_LOOK_PERIOD = 0.05  #: Period at which the moving objects of the vehicle's world are looked up, s.


class VirtualCrazyflieNode(ServerNode):
    """A virtual vehicle behind a UDP port.

    What moves in its world is where /tf says, or where it began.
    """

    settings_type = VehicleSettings
    server_type = VehicleServer

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        super().register_callbacks(handle)
        physics = cast(VehicleServer, self._server).vehicle.physics
        if physics.world is not None and physics.world.moving:
            self._lookup = handle.listen_to_transforms()
            handle.timer(_LOOK_PERIOD, partial(self._look, physics, physics.world))

    def _look(self, physics, world):
        centres = {}
        for each in world.moving:
            try:
                place = self._lookup(world.frame, each.name).transform.translation
            except TransformError:
                # No node moves it at present: it stays where it is.
                continue
            centres[each.name] = (place.x, place.y, place.z)
        physics.world = world.placed(centres)
