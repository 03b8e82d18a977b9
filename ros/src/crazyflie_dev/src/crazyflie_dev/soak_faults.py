"""Faults of a soak: poses, nodes, the clock, other programs, calls and live parameters.

A fault is a generator of steps, twenty a second; its end is its ``close()``.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from random import Random
from typing import Any

import genpy
import rospkg
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import DoubleParameter, StrParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from std_srvs.srv import EmptyRequest
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped, PositionVelocityStateStamped
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.tf.poses import RawTransforms

CONTROLLER, ESTIMATOR, SERVER, FILTER = (
    "/lqr_controller",
    "/state_estimator",
    "/takeoff_server",
    "/takeoff_control_filter",
)
NODES = (CONTROLLER, ESTIMATOR, SERVER, FILTER)
_RESPAWN = 1.0  #: Time from the end of a node until roslaunch has started it again (s).
_FLIGHT_LIMIT = 10.0  #: Longest wait of a node that is to end for the end of a flight (s).

HIGHEST = 1.4  #: Highest place that people ask for, m.
_HEIGHT = 1.0  #: Height of references of other programs (m).
_UP = (0.0, 0.0, _HEIGHT)
#: Height of a reference that climbs from `_HEIGHT` at 2 m/s, the limit, for 0.5 s (m).
_MOVED = _HEIGHT + 1.0
Steps = Generator[None, None, None]


@dataclass
class Flight:
    """The flight on which faults act."""

    graph: FakeGraph
    random: Random
    respawn: Callable[[str], None]  #: ``respawn(name)`` starts a node's process again.


Act = Callable[[Flight], object]


@dataclass
class Fault:
    """A fault: what it does, and how long it lasts."""

    name: str
    run: Callable[[Flight], Steps]
    #: shortest, longest: s.
    shortest: float
    longest: float
    blinds: bool = False  #: Whether there is no good pose while it lasts.
    #: Whether the vehicle may fall: nothing passes the last node before it, or its motors are to
    #: stand still.
    drops: bool = False
    height: float = 0.0  #: Highest reference that it may lead to, m.
    starves: bool = False  #: Whether all nodes stop again and again.
    is_emergency: bool = False  #: Whether motors have to stand still.


def lasting(begin: Act, end: Act = lambda _: None) -> Callable[[Flight], Steps]:
    """Return a fault that acts at its beginning and at its end."""

    def run(flight):
        begin(flight)
        try:
            while True:
                yield
        finally:
            end(flight)

    return run


def repeated(act: Act) -> Callable[[Flight], Steps]:
    """Return a fault that acts at each step."""

    def run(flight):
        while True:
            act(flight)
            yield

    return run


def together(*faults: Callable[[Flight], Steps]) -> Callable[[Flight], Steps]:
    """Return faults as one; they end in this order."""

    def run(flight):
        steps = [fault(flight) for fault in faults]
        try:
            yield from (None for _ in zip(*steps, strict=True))
        finally:
            for each in steps:
                each.close()

    return run


# Poses.


def on_tf(change: Callable[[Any, Flight], list[Any]]) -> Callable[[Flight], Steps]:
    """Return a fault: ``change(message, flight)`` returns what arrives on /tf."""

    def begin(flight):
        flight.graph.faults["/tf"] = lambda message: change(message, flight)

    return lasting(begin, lambda flight: flight.graph.faults.pop("/tf"))


def with_each(edit: Callable[[Any, Flight], None]) -> Callable[[Flight], Steps]:
    """Return a fault: ``edit(transform, flight)`` changes each transform on /tf."""

    def change(message, flight):
        # Transforms are decoded whenever they are asked for, and have to be encoded again.
        changed = TFMessage(copy.deepcopy(message.transforms))
        for transform in changed.transforms:
            edit(transform, flight)
        encoded = BytesIO()
        changed.serialize(encoded)
        return [RawTransforms().deserialize(encoded.getvalue())]

    return on_tf(change)


def _setting(part: str, name: str, value: float) -> Callable[[Flight], Steps]:
    return with_each(lambda each, _: setattr(getattr(each.transform, part), name, value))


def _jump(transform, flight):
    translation = transform.transform.translation
    translation.x += flight.random.uniform(-3.0, 3.0)
    translation.z += flight.random.uniform(-1.0, 3.0)


def _shift(offset: float) -> Callable[[Flight], Steps]:
    def edit(transform, _):
        stamp = max(0.0, transform.header.stamp.to_sec() + offset)
        transform.header.stamp = genpy.Time.from_sec(stamp)

    return with_each(edit)


def _freeze_camera(flight):
    """Repeat the first pose in the air, with the stamps of those that follow."""
    first: dict[str, Any] = {}

    # On the ground poses that repeat are true.
    def change(transform, _):
        if first or transform.transform.translation.z > 0.1:
            transform.transform = first.setdefault(transform.child_frame_id, transform.transform)

    yield from with_each(change)(flight)


# Nodes and the clock.


def _kill(name: str) -> Callable[[Flight], Steps]:
    return lasting(lambda flight: flight.graph.kill(name), lambda flight: flight.respawn(name))


def _freeze(name: str) -> Callable[[Flight], Steps]:
    return lasting(lambda flight: flight.graph.freeze(name), lambda flight: flight.graph.thaw(name))


def _starve(flight):
    """Run nodes for 50 ms and stop them for 0.1 to 0.6 s, each at times of its own."""
    ends: dict[str, float] = {}
    try:
        while True:
            now = flight.graph.time
            over = [name for name, end in ends.items() if now >= end]
            for name in NODES:
                if name not in ends:
                    flight.graph.freeze(name)
                    ends[name] = now + flight.random.uniform(0.1, 0.6)
            for name in over:
                del ends[name]
                flight.graph.thaw(name)
            yield
    finally:
        for name in ends:
            flight.graph.thaw(name)


def _second_launch(name: str) -> Callable[[Flight], Steps]:
    """Return a fault: a node waits for the end of the flight, then its namesake takes its place."""

    def replace(flight):
        flight.graph.end(name)
        flight.respawn(name)

    return lasting(lambda flight: flight.graph.interrupt(name), replace)


def _set_clock(flight):
    """Set the wall clock by 0.05 s to a day, and back."""
    step = flight.random.choice((-1.0, 1.0)) * 10 ** flight.random.uniform(-1.3, 4.9)
    set_clock = flight.graph.step_wall_clock
    yield from lasting(lambda _: set_clock(step), lambda _: set_clock(-step))(flight)


# Other programs.


def _refer_to(*state: float, age: float = 0.0) -> Callable[[Flight], None]:
    """Return what publishes a reference: x, y, z, x_dot, y_dot, z_dot."""

    def publish(flight):
        message = PositionVelocityStateStamped()
        message.header.stamp = genpy.Time.from_sec(flight.graph.stamp().to_sec() - age)
        for name, value in zip(("x", "y", "z", "x_dot", "y_dot", "z_dot"), state, strict=False):
            setattr(message.state, name, value)
        flight.graph.publish("/ref", message)

    return publish


def _command(topic: str, **control: float) -> Callable[[Flight], Steps]:
    def publish(flight):
        message = ControlStamped(control=Control(**control))
        message.header.stamp = flight.graph.stamp()
        flight.graph.publish(topic, message)

    return repeated(publish)


# People: services and parameters. All of it is legal, but single values of parameters.


def _call(service, flight):
    flight.graph.call(service, EmptyRequest())


def _hammer(flight):
    for _ in range(20):
        _call_server(flight)


def _call_server(flight):
    _call(flight.random.choice(("/takeoff", "/land")), flight)


_emergency = lasting(partial(_call, "/emergency"), partial(_call, "/emergency_reset"))

_SET = "/set_parameters"

_CONFIGS = f"{rospkg.RosPack().get_path('crazyflie_lqr')}/config"

#: Full name of each live parameter of the example -> lowest and highest value with which the
#: vehicle can fly, or the only one; nothing where the present one stays. Gains of the other sign,
#: and noise of metres, are legal, too; no controller flies with them. A descent speed of 0 is a
#: landing by the bare ramp, as documented: from 1 m the vehicle meets the ground at 3 m/s.
LIVE_VALUES: dict[str, tuple[Any, ...]] = {
    "/takeoff_server/hover/x": (-1.0, 1.0),
    "/takeoff_server/hover/y": (-1.0, 1.0),
    "/takeoff_server/hover/z": (0.3, HIGHEST),
    "/takeoff_server/landing/descent_speed": (0.1, 1.0),
    "/lqr_controller/K_file": (),
    "/lqr_controller/u_ref_file": (f"{_CONFIGS}/u_ref_hover.txt",),
    "/lqr_controller/reference/max_jump": (0.5, 5.0),
    "/lqr_controller/reference/max_speed": (0.2, 2.0),
    "/lqr_controller/integrator/k/x": (-0.3, 0.0),
    "/lqr_controller/integrator/k/y": (0.0, 0.3),
    "/lqr_controller/integrator/k/z": (-20.0, 0.0),
    "/lqr_controller/integrator/thresh/x": (0.0, 0.2),
    "/lqr_controller/integrator/thresh/y": (0.0, 0.2),
    "/lqr_controller/integrator/thresh/z": (0.0, 0.25),
    "/simulator/mocap/position_noise": (0.0, 0.0005),
    "/simulator/mocap/attitude_noise": (0.0, 0.005),
    "/simulator/mocap/latency": (0.0, 0.02),
    "/simulator/mocap/dropout": (0.0, 0.3),
    "/simulator/mass_error": (-0.05, 0.05),
    "/simulator/thrust_error": (-0.05, 0.05),
    "/simulator/wind/x": (-0.5, 0.5),
    "/simulator/wind/y": (-0.5, 0.5),
    "/simulator/wind/z": (-0.2, 0.2),
    "/simulator/wind/gust": (0.0, 0.3),
    "/simulator/wind/gust_time": (0.2, 2.0),
}


def live_parameters(graph: FakeGraph) -> dict[str, Any]:
    """Return the live parameters of all nodes, as they publish them: full name -> value."""
    return {
        f"{service.removesuffix(_SET)}/{name}": value
        for service in graph.services()
        if service.endswith(_SET)
        for updates in graph.latched(
            f"{service.removesuffix(_SET)}/parameter_updates", excluding=""
        )
        for name, value in decode_config(updates).items()
        if name != "groups"
    }


def _set(graph, full_name, value):
    for service in graph.services():
        node = service.removesuffix(_SET)
        if service.endswith(_SET) and full_name.startswith(f"{node}/"):
            config = encode_config({full_name.removeprefix(f"{node}/"): value})
            graph.call(service, ReconfigureRequest(config))


def _change_parameters(flight):
    """Change a parameter at each fifth step, and restore all of them at the end."""
    before = {n: v for n, v in live_parameters(flight.graph).items() if LIVE_VALUES[n]}
    try:
        while True:
            if flight.random.random() < 0.2:
                _change_a_parameter(flight)
            yield
    finally:
        for name, value in before.items():
            _set(flight.graph, name, value)


def _change_a_parameter(flight):
    live = [name for name in live_parameters(flight.graph) if LIVE_VALUES[name]]
    name = flight.random.choice(live)
    values = LIVE_VALUES[name]
    inside = [flight.random.uniform(*values)] if len(values) == 2 else []
    _set(flight.graph, name, flight.random.choice([*values, *inside]))


def _set_nonsense(flight):
    graph, random = flight.graph, flight.random
    config = encode_config({})
    number = random.choice(("", "hover/z", "integrator/k/z"))
    config.doubles = [DoubleParameter(number, math.nan)]
    config.strs = [StrParameter(random.choice(("K_file", "hover/x")), "no such value")]
    service = random.choice([each for each in graph.services() if each.endswith(_SET)])
    graph.call(service, ReconfigureRequest(config))


_blind, _dropping = partial(Fault, blinds=True), partial(Fault, drops=True)
_lqr, _takeoff = partial(_command, "/control/lqr"), partial(_command, "/control/takeoff")

FAULTS = [
    _blind("poses stop for a moment", on_tf(lambda *_: []), 0.05, 0.45),
    _blind("poses stop", on_tf(lambda *_: []), 0.7, 9.0),
    Fault(
        "every second pose is lost",
        on_tf(lambda m, flight: [m] * flight.random.choice((0, 1))),
        1.0,
        5.0,
    ),
    _blind("poses are not finite", _setting("translation", "x", math.nan), 0.3, 4.0),
    _blind("quaternions are no rotations", _setting("rotation", "w", 0.0), 0.3, 4.0),
    _blind("poses jump", with_each(_jump), 0.3, 4.0),
    _blind("stamps are 3 s old", _shift(-3.0), 0.3, 4.0),
    _blind("stamps are 8 s ahead", _shift(8.0), 0.3, 4.0),
    _blind("the camera is frozen", _freeze_camera, 1.0, 10.0),
    *(Fault(f"{n} is killed", _kill(n), _RESPAWN, _RESPAWN, drops=n == FILTER) for n in NODES),
    *(Fault(f"{n} is frozen", _freeze(n), 0.1, 4.0, drops=n == FILTER) for n in NODES),
    _dropping("this computer is too busy", _starve, 2.0, 12.0, starves=True),
    Fault("a second launch", together(*map(_second_launch, NODES)), _FLIGHT_LIMIT, _FLIGHT_LIMIT),
    Fault("the wall clock is set", _set_clock, 0.1, 4.0),
    *(
        Fault(f"the wall clock is set and {n} stopped", together(_set_clock, _freeze(n)), 0.1, 0.4)
        for n in NODES
    ),
    Fault(
        "the server is stopped and called",
        together(_freeze(SERVER), repeated(_call_server)),
        0.1,
        4.0,
    ),
    Fault("references are not finite", repeated(_refer_to(math.nan, 0.0, 1.0)), 0.1, 5.0),
    Fault("references are far away", repeated(_refer_to(50.0, -50.0, 1.0)), 0.1, 5.0),
    Fault("references are old", repeated(_refer_to(0.5, 0.5, 0.3, age=30.0)), 0.1, 5.0),
    Fault("another node streams references", repeated(_refer_to(0.3, 0.2, 1.0)), 3.0, 9.0),
    Fault("one reference flies", lasting(_refer_to(*_UP, 5.0)), 1.0, 5.0, height=_HEIGHT),
    Fault("one reference climbs", lasting(_refer_to(*_UP, 0.0, 0.0, 5.0)), 1.0, 5.0, height=_MOVED),
    Fault("references fly", repeated(_refer_to(*_UP, 1e2, -1e2, 1e2)), 1.0, 5.0, height=_MOVED),
    Fault("references sink", repeated(_refer_to(*_UP, 0.0, 2.0, -1e2)), 1.0, 5.0, height=_HEIGHT),
    Fault("a second controller lifts", _lqr(thrust=20.0), 0.5, 5.0),
    Fault("a second controller drops", _lqr(thrust=0.0), 0.5, 5.0),
    Fault("a second controller tilts", _lqr(roll=1.0, thrust=15.0), 0.5, 5.0),
    Fault("controls are huge", _lqr(pitch=-1e300, thrust=1e300), 0.5, 5.0),
    Fault("a second server lifts", _takeoff(thrust=20.0), 0.5, 5.0),
    Fault("services are hammered", repeated(_hammer), 0.1, 3.0),
    _dropping("emergency", _emergency, 0.2, 3.0, is_emergency=True),
    Fault("live parameters change", _change_parameters, 3.0, 9.0, height=HIGHEST),
    Fault("parameters get nonsense", repeated(_set_nonsense), 1.0, 5.0),
]
