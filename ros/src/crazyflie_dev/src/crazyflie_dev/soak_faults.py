"""What goes wrong in a soak: faults on topics, of nodes and by people."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from random import Random
from typing import Any

import genpy
from std_srvs.srv import EmptyRequest
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import PositionVelocityStateStamped
from crazyflie_utils.runtime.poses import RawTransforms
from crazyflie_utils.testing import FakeGraph

CONTROLLER, ESTIMATOR, SERVER, FILTER = (
    "/lqr_controller",
    "/state_estimator",
    "/takeoff_server",
    "/takeoff_control_filter",
)
NODES = (CONTROLLER, ESTIMATOR, SERVER, FILTER)

EMERGENCY = "emergency"
STARVATION = "this computer is too busy"

_RESPAWN = 1.0
"""From the end of a node until roslaunch has started it anew, s."""

_FROZEN_ABOVE = 0.02
"""A vehicle that is no higher, m, cannot be told from one that does not lift off."""

Undo = Callable[[], None]


@dataclass
class Flight:
    """What faults act on.

    Attributes
    ----------
    graph : FakeGraph
    random : Random
    respawn : callable
        ``respawn(name)`` starts a node's process anew.
    """

    graph: FakeGraph
    random: Random
    respawn: Callable[[str], None]


@dataclass
class Fault:
    """A fault: how it begins, how long it lasts.

    Attributes
    ----------
    name : str
    begin : callable
        ``begin(flight)`` returns what ends it.
    shortest, longest : float
        s.
    blinds : bool
        Whether there is no good pose while it lasts.
    drops : bool
        Whether the vehicle may fall: nothing passes the last node before it, or its motors
        are to stand still.
    again : callable, optional
        ``again(flight)`` is called twenty times a second while it lasts.
    """

    name: str
    begin: Callable[[Flight], Undo]
    shortest: float
    longest: float
    blinds: bool = False
    drops: bool = False
    again: Callable[[Flight], None] = lambda _: None


def _on_tf(change: Callable[[Any, Flight], list[Any]]) -> Callable[[Flight], Undo]:
    def begin(flight):
        flight.graph.faults["/tf"] = lambda message: change(message, flight)
        return lambda: flight.graph.faults.pop("/tf")

    return begin


def _with_each(edit: Callable[[Any, Flight], None]) -> Callable[[Flight], Undo]:
    def change(message, flight):
        # Transforms are decoded anew whenever they are asked for, and have to be encoded again.
        changed = TFMessage(copy.deepcopy(message.transforms))
        for transform in changed.transforms:
            edit(transform, flight)
        encoded = BytesIO()
        changed.serialize(encoded)
        return [RawTransforms().deserialize(encoded.getvalue())]

    return _on_tf(change)


def _nan(transform, _):
    transform.transform.translation.x = math.nan


def _flat_quaternion(transform, _):
    transform.transform.rotation.w = 0.0


def _jump(transform, flight):
    translation = transform.transform.translation
    translation.x += flight.random.uniform(-3.0, 3.0)
    translation.z += flight.random.uniform(-1.0, 3.0)


def _shift(offset: float) -> Callable[[Any, Flight], None]:
    def edit(transform, _):
        stamp = max(0.0, transform.header.stamp.to_sec() + offset)
        transform.header.stamp = genpy.Time.from_sec(stamp)

    return edit


def _freeze_camera(flight: Flight) -> Undo:
    """Repeat the first pose in the air, with the stamps of those that follow."""
    first: dict[str, Any] = {}

    def change(transform, _):
        if first or transform.transform.translation.z > _FROZEN_ABOVE:
            transform.transform = first.setdefault(transform.child_frame_id, transform.transform)

    return _with_each(change)(flight)


def _dropout(message, flight):
    return [] if flight.random.random() < 0.5 else [message]


def _kill(name: str) -> Callable[[Flight], Undo]:
    def begin(flight):
        if flight.graph.is_alive(name):
            flight.graph.kill(name)
        return lambda: flight.respawn(name)

    return begin


def _freeze(name: str) -> Callable[[Flight], Undo]:
    def begin(flight):
        flight.graph.freeze(name)
        return lambda: flight.graph.thaw(name)

    return begin


class _Starvation:
    """Nodes that run for 50 ms and then stop for 0.1 to 0.6 s, each at other times than the others.

    So it is on a computer that is too busy.
    """

    def __init__(self) -> None:
        self._stopped: dict[str, float] = {}

    def begin(self, flight: Flight) -> Undo:
        """Begin with all nodes at work."""
        self._stopped.clear()
        return lambda: self._thaw(flight, list(self._stopped))

    def again(self, flight: Flight) -> None:
        """Stop the nodes that have run, and let those go on whose time is up."""
        now = flight.graph.time
        over = [name for name, end in self._stopped.items() if now >= end]
        for name in NODES:
            if name not in self._stopped and flight.graph.is_alive(name):
                flight.graph.freeze(name)
                self._stopped[name] = now + flight.random.uniform(0.1, 0.6)
        self._thaw(flight, over)

    def _thaw(self, flight, names):
        for name in names:
            del self._stopped[name]
            flight.graph.thaw(name)


_starvation = _Starvation()


def _nothing(_: Flight) -> Undo:
    return lambda: None


def _refer_to(
    x: float, y: float, z: float, age: float = 0.0, speed: float = 0.0
) -> Callable[[Flight], None]:
    def publish(flight):
        message = PositionVelocityStateStamped()
        message.header.stamp = genpy.Time.from_sec(flight.graph.time - age)
        message.state.x, message.state.y, message.state.z = x, y, z
        message.state.x_dot, message.state.y_dot, message.state.z_dot = speed, -speed, speed
        flight.graph.publish("/ref", message)

    return publish


def _call_everything(flight: Flight) -> None:
    for _ in range(20):
        flight.graph.call(flight.random.choice(("/takeoff", "/land")), EmptyRequest())


def _stop_motors(flight: Flight) -> Undo:
    flight.graph.call("/emergency", EmptyRequest())

    def reset():
        flight.graph.call("/emergency_reset", EmptyRequest())

    return reset


FROZEN_CAMERA = Fault("motion capture is frozen", _freeze_camera, 0.3, 9.0, blinds=True)
"""Not among the others: the first frozen pose shows a slower vehicle, and the thrust that answers
it is held until the filter notices the silence."""

WRONG_VELOCITIES = Fault(
    "velocities are wrong", _nothing, 0.1, 5.0, again=_refer_to(0.0, 0.0, 1.0, speed=100.0)
)
"""Not yet among the others either."""

FAULTS = [
    Fault("poses stop for a moment", _on_tf(lambda *_: []), 0.05, 0.45, blinds=True),
    Fault("poses stop", _on_tf(lambda *_: []), 0.7, 9.0, blinds=True),
    Fault("every second pose is lost", _on_tf(_dropout), 1.0, 5.0),
    Fault("poses are not finite", _with_each(_nan), 0.3, 4.0, blinds=True),
    Fault("quaternions are no rotations", _with_each(_flat_quaternion), 0.3, 4.0, blinds=True),
    Fault("poses jump", _with_each(_jump), 0.3, 4.0, blinds=True),
    Fault("stamps are 3 s old", _with_each(_shift(-3.0)), 0.3, 4.0, blinds=True),
    Fault("stamps are 8 s ahead", _with_each(_shift(8.0)), 0.3, 4.0, blinds=True),
    *(
        Fault(f"{name} is killed", _kill(name), _RESPAWN, _RESPAWN, drops=name == FILTER)
        for name in NODES
    ),
    *(Fault(f"{name} is frozen", _freeze(name), 0.1, 4.0, drops=name == FILTER) for name in NODES),
    Fault(STARVATION, _starvation.begin, 2.0, 12.0, drops=True, again=_starvation.again),
    Fault("references are not finite", _nothing, 0.1, 5.0, again=_refer_to(math.nan, 0.0, 1.0)),
    Fault("references are far away", _nothing, 0.1, 5.0, again=_refer_to(50.0, -50.0, 1.0)),
    Fault("references are old", _nothing, 0.1, 5.0, again=_refer_to(0.5, 0.5, 0.3, age=30.0)),
    Fault("somebody streams references", _nothing, 3.0, 9.0, again=_refer_to(0.3, 0.2, 1.0)),
    Fault("services are hammered", _nothing, 0.1, 3.0, again=_call_everything),
    Fault(EMERGENCY, _stop_motors, 0.2, 3.0, drops=True),
]
