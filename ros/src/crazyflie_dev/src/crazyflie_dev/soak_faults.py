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
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.tf.poses import RawTransforms

CONTROLLER, ESTIMATOR, SERVER, FILTER = (
    "/lqr_controller",
    "/state_estimator",
    "/takeoff_server",
    "/takeoff_control_filter",
)
NODES = (CONTROLLER, ESTIMATOR, SERVER, FILTER)

EMERGENCY = "emergency"
STARVATION = "this computer is too busy"

_RESPAWN = 1.0  #: From the end of a node until roslaunch has started it anew, s.

Undo = Callable[[], None]


@dataclass
class Flight:
    """What faults act on."""

    graph: FakeGraph
    random: Random
    respawn: Callable[[str], None]  #: ``respawn(name)`` starts a node's process anew.


@dataclass
class Fault:
    """A fault: how it begins, how long it lasts."""

    name: str
    begin: Callable[[Flight], Undo]  #: ``begin(flight)`` returns what ends it.
    #: shortest, longest: s.
    shortest: float
    longest: float
    blinds: bool = False  #: Whether there is no good pose while it lasts.
    #: Whether the vehicle may fall: nothing passes the last node before it, or its motors are to
    #: stand still.
    drops: bool = False
    #: ``again(flight)`` is called twenty times a second while it lasts.
    again: Callable[[Flight], None] = lambda _: None
    height: float = 0.0  #: Highest reference that it may lead to, m.


def on_tf(change: Callable[[Any, Flight], list[Any]]) -> Callable[[Flight], Undo]:
    """Return what begins a fault: ``change(message, flight)`` returns what arrives on /tf."""

    def begin(flight):
        flight.graph.faults["/tf"] = lambda message: change(message, flight)
        return lambda: flight.graph.faults.pop("/tf")

    return begin


def with_each(edit: Callable[[Any, Flight], None]) -> Callable[[Flight], Undo]:
    """Return what begins a fault: ``edit(transform, flight)`` changes each transform on /tf."""

    def change(message, flight):
        # Transforms are decoded anew whenever they are asked for, and have to be encoded again.
        changed = TFMessage(copy.deepcopy(message.transforms))
        for transform in changed.transforms:
            edit(transform, flight)
        encoded = BytesIO()
        changed.serialize(encoded)
        return [RawTransforms().deserialize(encoded.getvalue())]

    return on_tf(change)


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


def _step_clock(flight):
    step = flight.random.uniform(-5.0, 5.0)
    flight.graph.step_wall_clock(step)
    return lambda: flight.graph.step_wall_clock(-step)


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


def nothing(_: Flight) -> Undo:
    """Begin a fault that consists of what is repeated while it lasts."""
    return lambda: None


def _refer_to(x: float, y: float, z: float, age: float = 0.0) -> Callable[[Flight], None]:
    def publish(flight):
        message = PositionVelocityStateStamped()
        message.header.stamp = genpy.Time.from_sec(flight.graph.time - age)
        message.state.x, message.state.y, message.state.z = x, y, z
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


FAULTS = [
    Fault("poses stop for a moment", on_tf(lambda *_: []), 0.05, 0.45, blinds=True),
    Fault("poses stop", on_tf(lambda *_: []), 0.7, 9.0, blinds=True),
    Fault("every second pose is lost", on_tf(_dropout), 1.0, 5.0),
    Fault("poses are not finite", with_each(_nan), 0.3, 4.0, blinds=True),
    Fault("quaternions are no rotations", with_each(_flat_quaternion), 0.3, 4.0, blinds=True),
    Fault("poses jump", with_each(_jump), 0.3, 4.0, blinds=True),
    Fault("stamps are 3 s old", with_each(_shift(-3.0)), 0.3, 4.0, blinds=True),
    Fault("stamps are 8 s ahead", with_each(_shift(8.0)), 0.3, 4.0, blinds=True),
    *(
        Fault(f"{name} is killed", _kill(name), _RESPAWN, _RESPAWN, drops=name == FILTER)
        for name in NODES
    ),
    *(Fault(f"{name} is frozen", _freeze(name), 0.1, 4.0, drops=name == FILTER) for name in NODES),
    Fault(STARVATION, _starvation.begin, 2.0, 12.0, drops=True, again=_starvation.again),
    Fault("the wall clock is set", _step_clock, 0.1, 4.0),
    Fault("references are not finite", nothing, 0.1, 5.0, again=_refer_to(math.nan, 0.0, 1.0)),
    Fault("references are far away", nothing, 0.1, 5.0, again=_refer_to(50.0, -50.0, 1.0)),
    Fault("references are old", nothing, 0.1, 5.0, again=_refer_to(0.5, 0.5, 0.3, age=30.0)),
    Fault("another node streams references", nothing, 3.0, 9.0, again=_refer_to(0.3, 0.2, 1.0)),
    Fault("services are hammered", nothing, 0.1, 3.0, again=_call_everything),
    Fault(EMERGENCY, _stop_motors, 0.2, 3.0, drops=True),
]
