"""What people do in a soak, all of it legal: change parameters, call services, lose missions."""

from __future__ import annotations

import math
from random import Random
from typing import Any

import genpy
import roslib.message
import rospkg
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.msg import DoubleParameter, StrParameter
from dynamic_reconfigure.srv import ReconfigureRequest

from crazyflie_dev.soak_faults import Fault, Flight, Undo, nothing
from crazyflie_utils.testing import FakeGraph

MISSION = "/mission"  #: The node that makes references of a mission's commands.
#: It, as a launch file names nodes of a process.
MISSION_NODE = {MISSION.strip("/"): "crazyflie_fleet.high_level_node:HighLevelNode"}

MISSION_PARAMETERS = {
    f"{MISSION}/topics/ref": "/ref",
    f"{MISSION}/topics/state": "/state",
    f"{MISSION}/topics/flight_state": "/in_flight_state",
    f"{MISSION}/srv/takeoff": "/takeoff",
    f"{MISSION}/srv/land": "/land",
    f"{MISSION}/srv/emergency": "/emergency",
}

HIGHEST = 1.4  #: Highest place that people ask for, m.
SUM_HEIGHT = 5.0  #: Highest place to which random services lead, m: relative goals add up.
_STREAM_RADIUS, _STREAM_SPEED = 0.5, 0.6  #: Of the circle that a mission streams, m and m/s.

#: Services that drop a vehicle, or release the motors of one that was dropped; they have a fault of
#: their own.
_MOTORS_OFF = ("/emergency", "/emergency_reset")

_SET = "/set_parameters"

# The driver's tests use this package, so that it cannot depend on the driver.
_full_state = roslib.message.get_message_class("crazyflie_driver/FullState")

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


# Parameters.


def live_parameters(graph: FakeGraph) -> dict[str, Any]:
    """Return the live parameters of all nodes, as they publish them: full name -> value."""
    return {
        f"{node}/{name}": value
        for node in _configurable(graph)
        for updates in graph.latched(f"{node}/parameter_updates", besides="")
        for name, value in decode_config(updates).items()
        if name != "groups"
    }


def _configurable(graph):
    return [name.removesuffix(_SET) for name in graph.services() if name.endswith(_SET)]


def _set(graph, values):
    for name, value in values.items():
        for node in _configurable(graph):
            if name.startswith(f"{node}/"):
                config = encode_config({name.removeprefix(f"{node}/"): value})
                graph.call(node + _SET, ReconfigureRequest(config))


def _restored(flight: Flight) -> Undo:
    before = {name: v for name, v in live_parameters(flight.graph).items() if LIVE_VALUES[name]}
    return lambda: _set(flight.graph, before)


def _change_a_parameter(flight: Flight) -> None:
    if flight.random.random() < 0.2:
        name = flight.random.choice([n for n in live_parameters(flight.graph) if LIVE_VALUES[n]])
        _set(flight.graph, {name: _live_value(name, flight.random)})


def _live_value(name: str, random: Random) -> Any:
    values = LIVE_VALUES[name]
    if len(values) == 1:
        return values[0]
    return random.choice((*values, random.uniform(*values)))


# Services.


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


def _any_config(node, graph, random):
    live = [n for n in live_parameters(graph) if n.startswith(f"{node}/") and LIVE_VALUES[n]]
    if live and random.random() < 0.5:
        name = random.choice(live)
        return encode_config({name.removeprefix(f"{node}/"): _live_value(name, random)})
    config = encode_config({})
    config.doubles = [DoubleParameter(random.choice(("", "hover/z", "integrator/k/z")), math.nan)]
    config.strs = [StrParameter(random.choice(("K_file", "hover/x")), "no such value")]
    return config


def _call_anything(flight: Flight) -> None:
    if flight.random.random() > 0.2:
        return
    graph, random = flight.graph, flight.random
    services: dict[str, Any] = graph.services()
    services = {n: t for n, t in services.items() if not n.endswith(_MOTORS_OFF)}
    name = random.choice(sorted(services))
    if name.endswith(_SET):
        request = ReconfigureRequest(_any_config(name.removesuffix(_SET), graph, random))
    else:
        request = any_message(services[name]._request_class, random)
    graph.call(name, request)


# Missions.


def _go(flight: Flight) -> Undo:
    random = flight.random
    services: dict[str, Any] = flight.graph.services()
    request = services[f"{MISSION}/go_to"]._request_class()
    request.duration = genpy.Duration.from_sec(random.uniform(1.0, 3.0))
    request.goal.x, request.goal.y = random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0)
    request.goal.z = random.uniform(0.6, HIGHEST)
    flight.graph.call(f"{MISSION}/go_to", request)

    def die():
        flight.graph.kill(MISSION)
        flight.respawn(MISSION)

    return die


def _stream(flight: Flight) -> None:
    angle = flight.graph.time * _STREAM_SPEED / _STREAM_RADIUS
    message = _full_state()
    message.header.stamp = flight.graph.stamp()
    message.pose.orientation.w = 1.0
    x, y = math.cos(angle), math.sin(angle)
    message.pose.position.x, message.pose.position.y = _STREAM_RADIUS * x, _STREAM_RADIUS * y
    message.pose.position.z = 1.0
    message.twist.linear.x, message.twist.linear.y = -_STREAM_SPEED * y, _STREAM_SPEED * x
    flight.graph.publish(f"{MISSION}/cmd_full_state", message)


FAULTS = [
    Fault("live parameters change", _restored, 3.0, 9.0, again=_change_a_parameter, height=HIGHEST),
    Fault(
        "services get any arguments", _restored, 3.0, 9.0, again=_call_anything, height=SUM_HEIGHT
    ),
    Fault("a mission dies in a move", _go, 0.1, 2.5, height=HIGHEST),
    Fault("a mission dies while it streams", nothing, 0.5, 5.0, again=_stream, height=1.0),
]
