"""The geofence's box, as its node publishes it."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from crazyflie_takeoff.limits import Box
from crazyflie_utils import NodeHandle

if TYPE_CHECKING:
    from dynamic_reconfigure.msg import Config


def follow_box(handle: NodeHandle, topic: str, callback: Callable[[Box], None]) -> None:
    """Have ``callback(box)`` called with the box of a geofence, now and after each change.

    Parameters
    ----------
    handle : NodeHandle
    topic : str
        The geofence's live parameters, latched.
    callback : callable
    """
    # Here, since most flights have no fence.
    from dynamic_reconfigure.msg import Config

    handle.subscribe(topic, Config, lambda message: callback(box_of(message)))


def box_of(message: "Config") -> Box:
    """Return the box that is among the parameters of a message; without a corner no wall."""
    values = {each.name: each.value for each in message.doubles}
    return Box(
        tuple(values.get(f"box/min/{axis}", -math.inf) for axis in "xyz"),
        tuple(values.get(f"box/max/{axis}", math.inf) for axis in "xyz"),
    )
