"""The geofence's box, as its node publishes it."""

import math
from collections.abc import Callable

from crazyflie_takeoff.limits import Box
from crazyflie_utils import NodeHandle


def follow_box(handle: NodeHandle, topic: str, callback: Callable[[Box], None]) -> None:
    """Have ``callback(box)`` called with the box of a geofence, now and after each change.

    ``topic`` has the geofence's live parameters, latched; without a corner there is no wall.
    """
    # Here, since most flights have no fence.
    from dynamic_reconfigure.msg import Config

    def on_config(message: Config) -> None:
        values = {each.name: each.value for each in message.doubles}
        lower = tuple(values.get(f"box/min/{axis}", -math.inf) for axis in "xyz")
        upper = tuple(values.get(f"box/max/{axis}", math.inf) for axis in "xyz")
        callback(Box(lower, upper))

    handle.subscribe(topic, Config, on_config)
