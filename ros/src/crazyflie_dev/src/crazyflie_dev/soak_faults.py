"""Faults of a soak: poses, nodes, the clock, other programs, and commands of people.

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
import roslib.message
import rospkg
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import DoubleParameter, StrParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from geometry_msgs.msg import Point
from std_srvs.srv import EmptyRequest
from tf2_msgs.msg import TFMessage

from crazyflie_msgs.msg import Control, ControlStamped, PositionVelocityStateStamped
from crazyflie_utils.testing import FakeGraph
from crazyflie_utils.tf.frame_tree import RawTransforms

CONTROLLER, ESTIMATOR, SERVER, FILTER = (
    "/lqr_controller",
    "/state_estimator",
    "/takeoff_server",
    "/takeoff_control_filter",
)
NODES = (CONTROLLER, ESTIMATOR, SERVER, FILTER)
#: Nodes that make references of a mission's commands, of two missions.
MISSIONS = ("/mission", "/second_mission")
#: Their topics and services are the vehicle's own.
MISSION_PARAMETERS = {
    "topics/ref": "/ref",
    "topics/state": "/state",
    "topics/flight_status": "/in_flight_flight_status",
    "srv/takeoff": "/takeoff",
    "srv/land": "/land",
    "srv/emergency": "/emergency",
}

_RESPAWN = 1.0  #: Time from the end of a node until roslaunch has started it again (s).
_FLIGHT_LIMIT = 10.0  #: Longest wait of a node that is to end for the end of a flight (s).

HIGHEST = 1.4  #: Highest place that people ask for, m.
_SUM_HEIGHT = 5.0  #: Highest place to which random services lead, m: relative goals add up.
_HEIGHT = 1.0  #: Height of references of other programs (m).
_UP = (0.0, 0.0, _HEIGHT)
#: Height of a reference that climbs from `_HEIGHT` at 2 m/s, the limit, for 0.5 s (m).
_MOVED = _HEIGHT + 1.0
#: Radius and speed of the circle that a mission streams (m, m/s).
_STREAM_RADIUS, _STREAM_SPEED = 0.5, 0.6

Steps = Generator[None, None, None]


@dataclass
class SoakFlight:
    """The flight on which faults act."""

    graph: FakeGraph
    random: Random
    respawn: Callable[[str], None]  #: ``respawn(name)`` starts a node's process again.


Act = Callable[[SoakFlight], object]


@dataclass
class Fault:
    """A fault: what it does, and how long it lasts."""

    name: str
    run: Callable[[SoakFlight], Steps]
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


def lasting(begin: Act, end: Act = lambda _: None) -> Callable[[SoakFlight], Steps]:
    """Return a fault that acts at its beginning and at its end."""

    def run(flight):
        begin(flight)
        try:
            while True:
                yield
        finally:
            end(flight)

    return run


def repeated(act: Act) -> Callable[[SoakFlight], Steps]:
    """Return a fault that acts at each step."""

    def run(flight):
        while True:
            act(flight)
            yield

    return run


def together(*faults: Callable[[SoakFlight], Steps]) -> Callable[[SoakFlight], Steps]:
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


def on_tf(change: Callable[[Any, SoakFlight], list[Any]]) -> Callable[[SoakFlight], Steps]:
    """Return a fault: ``change(message, flight)`` returns what arrives on /tf."""

    def begin(flight):
        flight.graph.faults["/tf"] = lambda message: change(message, flight)

    return lasting(begin, lambda flight: flight.graph.faults.pop("/tf"))


def with_each(edit: Callable[[Any, SoakFlight], None]) -> Callable[[SoakFlight], Steps]:
    """Return a fault: ``edit(transform, flight)`` changes each transform on /tf."""

    def change(message, flight):
        # Transforms are decoded at each access, and must be encoded again.
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


def _shift(offset: float) -> Callable[[SoakFlight], Steps]:
    def edit(transform, _):
        stamp = max(0.0, transform.header.stamp.to_sec() + offset)
        transform.header.stamp = genpy.Time.from_sec(stamp)

    return with_each(edit)


def _dropout(message, flight):
    return [] if flight.random.random() < 0.5 else [message]


def _freeze_camera(flight):
    """Repeat the first pose in the air, with the stamps of those that follow."""
    first: dict[str, Any] = {}

    # On the ground poses that repeat are true.
    def change(transform, _):
        if first or transform.transform.translation.z > 0.1:
            transform.transform = first.setdefault(transform.child_frame_id, transform.transform)

    yield from with_each(change)(flight)


# Nodes and the clock.


def _kill(name: str) -> Callable[[SoakFlight], Steps]:
    return lasting(lambda flight: flight.graph.kill(name), lambda flight: flight.respawn(name))


def _freeze(name: str) -> Callable[[SoakFlight], Steps]:
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


def _second_launch(name: str) -> Callable[[SoakFlight], Steps]:
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


def _refer_to(*state: float, age: float = 0.0) -> Callable[[SoakFlight], None]:
    """Return what publishes a reference: x, y, z, x_dot, y_dot, z_dot."""

    def publish(flight):
        message = PositionVelocityStateStamped()
        message.header.stamp = genpy.Time.from_sec(flight.graph.stamp().to_sec() - age)
        for name, value in zip(("x", "y", "z", "x_dot", "y_dot", "z_dot"), state, strict=False):
            setattr(message.state, name, value)
        flight.graph.publish("/ref", message)

    return publish


def _command(topic: str, **control: float) -> Callable[[SoakFlight], Steps]:
    def publish(flight):
        message = ControlStamped(control=Control(**control))
        message.header.stamp = flight.graph.stamp()
        flight.graph.publish(topic, message)

    return repeated(publish)


# People: services, parameters, missions. All of it is legal.


def _call(service, flight):
    flight.graph.call(service, EmptyRequest())


def _hammer(flight):
    for _ in range(20):
        _call(flight.random.choice(("/takeoff", "/land")), flight)


def _call_mission(flight, mission, service, **values):
    services: dict[str, Any] = flight.graph.services()
    duration = genpy.Duration.from_sec(flight.random.uniform(1.0, 3.0))
    request = services[f"{mission}/{service}"]._request_class(duration=duration, **values)
    flight.graph.call(f"{mission}/{service}", request)


def _call_server(flight):
    """Call the server as people and missions do, each twice a second on average."""
    service, height = flight.random.choice((("takeoff", _HEIGHT), ("land", 0.0)))
    if flight.random.random() < 0.1:
        _call(f"/{service}", flight)
    elif flight.random.random() < 0.1:
        _call_mission(flight, flight.random.choice(MISSIONS), service, height=height)


_emergency = lasting(partial(_call, "/emergency"), partial(_call, "/emergency_reset"))

#: Services that drop a vehicle, or release the motors of one that was dropped; they have a fault of
#: their own.
_MOTORS_OFF = ("/emergency", "/emergency_reset")

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
    "/lqr_controller/control/max_roll": (0.2, 0.26),
    "/lqr_controller/control/max_pitch": (0.2, 0.26),
    "/lqr_controller/control/max_thrust": (14.0, 16.0),
    "/lqr_controller/control/min_thrust": (4.0, 5.0),
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


def _changing(act: Callable[[SoakFlight], None]) -> Callable[[SoakFlight], Steps]:
    """Return a fault that calls ``act(flight)`` at each fifth step, and restores parameters."""

    def run(flight):
        before = {n: v for n, v in live_parameters(flight.graph).items() if LIVE_VALUES[n]}
        try:
            while True:
                if flight.random.random() < 0.2:
                    act(flight)
                yield
        finally:
            for name, value in before.items():
                _set(flight.graph, name, value)

    return run


def _change_a_parameter(flight, node=""):
    live = [name for name in live_parameters(flight.graph) if LIVE_VALUES[name]]
    name = flight.random.choice([each for each in live if each.startswith(f"{node}/")] or live)
    values = LIVE_VALUES[name]
    inside = [flight.random.uniform(*values)] if len(values) == 2 else []
    _set(flight.graph, name, flight.random.choice([*values, *inside]))


def any_message(message_type: type[genpy.Message], random: Random) -> genpy.Message:
    """Return a message with random values in all fields, legal and illegal ones."""
    message = message_type()
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        setattr(message, name, _any_value(kind, getattr(message, name), random))
    return message


def _any_value(kind, present, random):
    if kind.endswith("]"):
        return present
    if isinstance(present, genpy.Message):
        return any_message(type(present), random)
    if isinstance(present, genpy.TVal):
        return type(present)(random.randint(0, 4), random.randint(0, 999_999_999))
    if kind.startswith("float"):
        legal = random.uniform(-HIGHEST, HIGHEST)
        return random.choice((legal, legal, legal, 0.0, math.nan, math.inf, -math.inf))
    if kind.startswith("uint"):
        return random.choice((0, 1, 2 ** int(kind.removeprefix("uint")) - 1))
    if kind == "bool":
        return random.random() < 0.5
    return random.choice(("", "/", "cf1", "\N{SNOWMAN}"))


def _call_anything(flight):
    graph, random = flight.graph, flight.random
    services: dict[str, Any] = graph.services()
    name = random.choice(sorted(each for each in services if not each.endswith(_MOTORS_OFF)))
    if not name.endswith(_SET):
        graph.call(name, any_message(services[name]._request_class, random))
    elif random.random() < 0.5:
        _change_a_parameter(flight, name.removesuffix(_SET))
    else:
        config = encode_config({})
        number = random.choice(("", "hover/z", "integrator/k/z"))
        config.doubles = [DoubleParameter(number, math.nan)]
        config.strs = [StrParameter(random.choice(("K_file", "hover/x")), "no such value")]
        graph.call(name, ReconfigureRequest(config))


def _go(flight, mission=MISSIONS[0]):
    x, y = flight.random.uniform(-1.0, 1.0), flight.random.uniform(-1.0, 1.0)
    goal = Point(x, y, flight.random.uniform(0.6, HIGHEST))
    _call_mission(flight, mission, "go_to", goal=goal)


def _stream(flight, mission=MISSIONS[0], sense=1.0):
    """Publish a state on a circle, which the missions fly in opposite senses."""
    angle = sense * flight.graph.time * _STREAM_SPEED / _STREAM_RADIUS
    # The driver's tests use this package, so that it cannot depend on the driver.
    message = roslib.message.get_message_class("crazyflie_driver/FullState")()
    message.header.stamp = flight.graph.stamp()
    message.pose.orientation.w = 1.0
    x, y = math.cos(angle), math.sin(angle)
    message.pose.position.x, message.pose.position.y = _STREAM_RADIUS * x, _STREAM_RADIUS * y
    message.pose.position.z = 1.0
    speed = sense * _STREAM_SPEED
    message.twist.linear.x, message.twist.linear.y = -speed * y, speed * x
    flight.graph.publish(f"{mission}/cmd_full_state", message)


def _stream_both(flight):
    for mission, sense in zip(MISSIONS, (1.0, -1.0), strict=True):
        _stream(flight, mission, sense)


def _go_both(flight):
    if flight.random.random() < 0.1:
        _go(flight, flight.random.choice(MISSIONS))


def _end_mission(flight):
    flight.graph.kill(MISSIONS[0])
    flight.respawn(MISSIONS[0])


_called = repeated(_call_server)
_blind, _dropping = partial(Fault, blinds=True), partial(Fault, drops=True)
_lqr, _takeoff = partial(_command, "/control/lqr"), partial(_command, "/control/takeoff")

FAULTS = [
    _blind("poses stop for a moment", on_tf(lambda *_: []), 0.05, 0.45),
    _blind("poses stop", on_tf(lambda *_: []), 0.7, 9.0),
    Fault("every second pose is lost", on_tf(_dropout), 1.0, 5.0),
    _blind("poses are not finite", with_each(_nan), 0.3, 4.0),
    _blind("quaternions are not rotations", with_each(_flat_quaternion), 0.3, 4.0),
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
    Fault("the server is stopped and called", together(_freeze(SERVER), _called), 0.1, 4.0),
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
    Fault("live parameters change", _changing(_change_a_parameter), 3.0, 9.0, height=HIGHEST),
    Fault("services get any arguments", _changing(_call_anything), 3.0, 9.0, height=_SUM_HEIGHT),
    Fault("a mission dies in a move", lasting(_go, _end_mission), 0.1, 2.5, height=HIGHEST),
    Fault("a mission dies while it streams", repeated(_stream), 0.5, 5.0, height=1.0),
    Fault("two missions move one vehicle", repeated(_go_both), 1.0, 6.0, height=HIGHEST),
    Fault("two missions stream to one vehicle", repeated(_stream_both), 1.0, 6.0, height=1.0),
]
