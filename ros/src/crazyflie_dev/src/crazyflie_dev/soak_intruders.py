"""What programs that do not belong to the flight publish in a soak, and cameras that lie."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from crazyflie_dev.soak_faults import Fault, Flight, Undo, nothing, with_each
from crazyflie_msgs.msg import Control, ControlStamped, PositionVelocityStateStamped

_HEIGHT = 1.0  #: Of the references, m.
#: Where a reference at `_HEIGHT` gets that climbs: at 2 m/s, the most that counts, for 0.5 s, m.
_MOVED = _HEIGHT + 1.0
#: A camera freezes when the vehicle is above this, m: on the ground poses that repeat are true.
_FROZEN_ABOVE = 0.1


def _refer(x_dot: float, y_dot: float, z_dot: float) -> Callable[[Flight], None]:
    def publish(flight):
        message = PositionVelocityStateStamped()
        message.header.stamp = flight.graph.stamp()
        message.state.z = _HEIGHT
        message.state.x_dot, message.state.y_dot, message.state.z_dot = x_dot, y_dot, z_dot
        flight.graph.publish("/ref", message)

    return publish


def _once(publish: Callable[[Flight], None]) -> Callable[[Flight], Undo]:
    def begin(flight):
        publish(flight)
        return lambda: None

    return begin


def _command(topic: str, **control: float) -> Callable[[Flight], None]:
    def publish(flight):
        message = ControlStamped(control=Control(**control))
        message.header.stamp = flight.graph.stamp()
        flight.graph.publish(topic, message)

    return publish


def _freeze_camera(flight: Flight) -> Undo:
    """Repeat the first pose in the air, with the stamps of those that follow."""
    first: dict[str, Any] = {}

    def change(transform, _):
        if first or transform.transform.translation.z > _FROZEN_ABOVE:
            transform.transform = first.setdefault(transform.child_frame_id, transform.transform)

    return with_each(change)(flight)


_LQR, _TAKEOFF = "/control/lqr", "/control/takeoff"

FAULTS = [
    Fault("one reference flies", _once(_refer(5.0, 0.0, 0.0)), 1.0, 5.0, height=_HEIGHT),
    Fault("one reference climbs", _once(_refer(0.0, 0.0, 5.0)), 1.0, 5.0, height=_MOVED),
    Fault("references fly", nothing, 1.0, 5.0, again=_refer(100.0, -100.0, 100.0), height=_MOVED),
    Fault("references sink", nothing, 1.0, 5.0, again=_refer(0.0, 2.0, -100.0), height=_HEIGHT),
    Fault("a second controller lifts", nothing, 0.5, 5.0, again=_command(_LQR, thrust=20.0)),
    Fault("a second controller drops", nothing, 0.5, 5.0, again=_command(_LQR, thrust=0.0)),
    Fault(
        "a second controller tilts", nothing, 0.5, 5.0, again=_command(_LQR, roll=1.0, thrust=15.0)
    ),
    Fault("a second server lifts", nothing, 0.5, 5.0, again=_command(_TAKEOFF, thrust=20.0)),
    Fault("controls are huge", nothing, 0.5, 5.0, again=_command(_LQR, pitch=-1e300, thrust=1e300)),
    Fault("the camera is frozen", _freeze_camera, 1.0, 10.0, blinds=True),
]
