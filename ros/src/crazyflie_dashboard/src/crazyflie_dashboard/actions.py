"""Turns commands of the operator into service calls."""

import math
import subprocess
from collections.abc import Iterable
from typing import Any, NamedTuple

import genpy
import roslib.packages
from geometry_msgs.msg import Point
from std_srvs.srv import Empty, EmptyRequest, SetBool, SetBoolRequest

from crazyflie_dashboard.discovery import FoundVehicle, Graph, Service
from crazyflie_dashboard.graph_model import GraphModel
from crazyflie_dashboard.moves import Move, expect_apart, formation, in_frame
from crazyflie_dashboard.page_data import MAX_COMMAND_AGE, Command, Outcomes, gathered
from crazyflie_dashboard.snapshot import Action, Triple, VehicleSnapshot
from crazyflie_driver import srv
from crazyflie_fleet.fleet_config import BUFFER
from crazyflie_fleet.high_level_services import COMMAND, TAKEOFF_LEAD
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_model.lights import COLOR_LED_DECKS, wrgb
from crazyflie_takeoff.envelope import Box
from crazyflie_utils.refusal import RefusalError
from crazyflie_utils.steps import Steps, follow

_FLIGHT_TIMEOUT = 60.0  #: Timeout of services that answer when the vehicle flies or has landed (s).
_TIMEOUT = 10.0  #: Timeout of the other services (s).
_CLIMB_SPEED = 0.5  #: Mean speed of a takeoff (m/s).
_UNKNOWN_HEIGHT = 1.0  #: Assumed height of a landing vehicle without a position (m).
_MIN_DURATION = 1.0  #: Shortest duration of a move (s).
_MAX_SPEED = 2.0  #: Highest speed of a go-to command (m/s).
HEIGHTS = 0.1, 5.0  #: Lowest and highest takeoff (m).

#: Actions that a fleet carries out for several of its vehicles by one call, and the last name of
#: the service of each vehicle, by which its fleet is known.
_OF_FLEET = {
    Action.TAKEOFF: "high_level/takeoff",
    Action.LAND: "high_level/land",
    Action.HOLD: "high_level/go_to",
    Action.GO_TO: "high_level/go_to",
    Action.RESET: "emergency_reset",
}
_ROUNDING = 1e-6  #: Distance by which a goal may be out of bounds (m).

_HOLD_DURATION = 1.0  #: Duration of a move to a vehicle's own position (s).
#: The firmware's parameter for lights, its value for all lights, and how long they are on (s).
_LIGHTS, _ALL_LIGHTS, _LIGHT_TIME = "led/bitmask", 255, 5.0
_COLOR_LEDS = {k.replace(".", "/"): v.replace(".", "/") for k, v in COLOR_LED_DECKS.items()}

#: Actions that are refused in flight: the motors would stop.
_GROUND_ONLY = (Action.DISARM, Action.REBOOT)

_STAYS = "not all of them can go"
_WAITS = "not all of them can take off"

#: Parameters of the nodes that carry out a go-to command: whether headings can change; the frame of
#: goals.
_YAW, _FIXED = "reference/yaw", "frames/fixed"

_YAW_REFERENCE = "crazyflie_msgs/PositionVelocityYawStateStamped"


_LANDING = Command(Action.LAND, (), 0.0)


class Target(NamedTuple):
    """A vehicle and its newest snapshot when a command comes: its model changes meanwhile."""

    vehicle: FoundVehicle
    now: VehicleSnapshot


class Bounds(NamedTuple):
    """The box of a vehicle's goals (m), what it is in words, and whether it is a geofence's.

    A geofence is in the frame in which its vehicle is commanded; others are in the fixed frame.
    """

    box: Box
    what: str
    is_fence: bool = False


class Actions:
    """Calls services for commands of the model's vehicles.

    ``reach`` is, where there is no room and no geofence, the largest height of a goal, and its
    distance from the origin along x and y (m).
    """

    def __init__(self, model: GraphModel, reach: float = 10.0):
        self._model, self._reach = model, reach
        self._handle, self._time = model.handle, model.clock
        self._moves: dict[str, Move] = {}
        self._commanders: dict[str, subprocess.Popen[bytes]] = {}

    def carry_out(self, command: Command) -> "Steps[Outcomes]":
        """Call the services that a command needs; return all outcomes.

        `RefusalError`: the command is too old or invalid.
        """
        expect_fresh(command.action.value, self._time() - command.clicked)
        _check(command)
        scene = self._model.scene
        targets = {
            name: Target(model.vehicle, scene.vehicles[name])
            for name, model in self._model.models.items()
            if name in scene.vehicles
        }
        if command.action == Action.GO_TO:
            return (yield from self._go_to(command, targets, scene.fixed_frame))
        fleet = self._fleet(command, targets)
        if command.action == Action.TAKEOFF:
            is_asked = fleet or len(command.vehicles) == 1
            reasons = {
                name: self._why_it_stays_down(command.height, targets.get(name), is_asked)
                for name in command.vehicles
            }
            if any(reasons.values()):
                return _with_others(reasons, _WAITS)
        if command.action != Action.IDENTIFY:
            for name in command.vehicles:
                self._moves.pop(name, None)
        if fleet:
            request = _takeoff_request(command, targets[command.vehicles[0]])
            return (yield from self._call_fleet(command, request.duration))
        answers = {
            n: self._begin(self._command(command, targets.get(n), n)) for n in command.vehicles
        }
        outcomes = yield from gathered(answers)
        if command.action == Action.TAKEOFF and any(outcomes.values()):
            self._land([targets[name] for name, text in outcomes.items() if not text])
            outcomes = _with_others(outcomes, f"is landed: {_WAITS}")
        return outcomes

    def _land(self, targets):
        """Land those that were on the ground, since one of them has not taken off."""
        for target in targets:
            service = _service(target, Action.LAND)
            if service is not None and not target.now.is_in_flight:
                request = _request(_LANDING, service, target)
                self._handle.call_service(service.name, service.kind, request, _FLIGHT_TIMEOUT)

    def limits(self, names: Iterable[str]) -> tuple[Box, str] | None:
        """Return the smallest box of goals of vehicles (m), and what it is in words."""
        scene, models = self._model.scene.vehicles, self._model.models
        known = [Target(models[n].vehicle, scene[n]) for n in names if n in models and n in scene]
        if not known:
            return None
        # Most have the same ones: the room.
        bounds = {self._bounds(target) for target in known}
        lower = (max(each.box.lower[k] for each in bounds) for k in range(3))
        upper = (min(each.box.upper[k] for each in bounds) for k in range(3))
        return Box(tuple(lower), tuple(upper)), " and ".join(sorted({b.what for b in bounds}))

    def close(self) -> None:
        """End the commanders that were started here; each lives until its vehicle has landed."""
        for process in self._commanders.values():
            process.terminate() if process.poll() is None else None

    def _begin(self, steps):
        return follow(steps, self._handle.submit)

    def _fleet(self, command, targets):
        """Return whether one fleet carries out the command for all its vehicles by one call."""
        nodes, last = self._model.graph.services, _OF_FLEET.get(command.action)
        owners = {
            nodes.get(f"{targets[name].vehicle.namespace}/{last}") if name in targets else None
            for name in command.vehicles
        }
        return len(command.vehicles) > 1 and owners == {nodes.get(COMMAND, "")}

    def _call_fleet(self, command, duration, **goals):
        """Command vehicles of a fleet; return its answer, which is that of each of them."""
        request = srv.CommandVehiclesRequest(
            names=[*command.vehicles],
            command=command.action.value,
            height=command.height,
            duration=duration,
            **goals,
        )
        answer = self._begin(self._call(command, Service(COMMAND, srv.CommandVehicles), request))
        return (yield from gathered(dict.fromkeys(command.vehicles, answer)))

    def _why_it_stays_down(self, height, target, is_asked):
        """Return why a vehicle cannot take off, or ""; one that is asked says so itself."""
        if _service(target, Action.TAKEOFF) is None:
            return _why_no_service(Action.TAKEOFF, target)
        box, what, _ = self._bounds(target)
        if height > box.upper[2]:
            return (
                f"take off: the height is {height:g} m; expected at most {box.upper[2]:g} m, where "
                f"{what} ends"
            )
        return "" if is_asked or target.now.is_in_flight else target.now.takeoff_refusal

    def _bounds(self, target):
        """Return where the goals of a vehicle may be."""
        if (fence := self._model.fence(target.vehicle)) is not None:
            return Bounds(fence, "its geofence", True)
        if (room := self._model.room()) is not None:
            return Bounds(room, "the room of the world file")
        reach = self._reach
        box = Box((-reach, -reach, 0.0), (reach, reach, reach))
        return Bounds(box, "the limits of goals (~goal_limit)")

    def _command(self, command, target, name):
        service = _service(target, command.action)
        if service is None:
            raise RefusalError(_why_no_service(command.action, target))
        if command.action in _GROUND_ONLY and target.now.is_in_flight:
            raise RefusalError(
                f"{command.action.value}: the vehicle is {target.now.state}; expected it to be on "
                "the ground"
            )
        if command.action == Action.IDENTIFY:
            yield from self._light(service.name.rpartition("/")[0], command)
            return
        go_to = _service(target, Action.GO_TO)
        if command.action == Action.TAKEOFF and go_to is not None and go_to.needs_commander:
            self._start_commander(target.vehicle)
        yield from self._call(command, service, _request(command, service, target))

    def _call(self, command: Command, service: Service, request: Any) -> Steps[None]:
        """Call a service unless the command becomes too old before the service is reached."""
        age = self._time() - command.clicked
        expect_fresh(command.action.value, age)
        limit = _FLIGHT_TIMEOUT if command.action in (Action.TAKEOFF, Action.LAND) else _TIMEOUT
        # A call that does not reach its node is withdrawn: a frozen node must not carry it out
        # later.
        answer = yield self._handle.call_service(
            service.name, service.kind, request, limit, MAX_COMMAND_AGE - age
        )
        if getattr(answer, "success", True) is False:
            raise RefusalError(answer.message)

    def _light(self, driver, command):
        """Switch on all lights of a vehicle for `_LIGHT_TIME`, by its firmware."""
        service = Service(f"{driver}/update_params", srv.UpdateParams)
        names = [f"{driver}/{each}" for deck in _COLOR_LEDS.items() for each in deck]
        known = yield self._model.workers.submit(self._model.master.parameters, names)
        decks = [color for deck, color in _COLOR_LEDS.items() if known.get(f"{driver}/{deck}")]
        lit = {_LIGHTS: _ALL_LIGHTS, **dict.fromkeys(decks, wrgb(1.0, 1.0, 1.0))}
        before = {_LIGHTS: 0, **{color: known[f"{driver}/{color}"] for color in decks}}
        request = srv.UpdateParamsRequest([*lit])

        def write(values):
            for name, value in values.items():
                yield self._handle.set_param_later(f"{driver}/{name}", value)

        def off():
            timer.stop()
            yield from write(before)
            self._handle.call_service(service.name, service.kind, request, _TIMEOUT)

        timer = self._handle.timer(_LIGHT_TIME, lambda: self._begin(off()), steady=True)
        yield from write(lit)
        yield from self._call(command, service, request)

    # Go-to commands for several vehicles.

    def _go_to(self, command, targets, fixed):
        """Send vehicles so that their centre comes to the goal: all of them, or none."""
        reasons = {n: self._why_it_stays(targets.get(n)) for n in command.vehicles}
        if any(reasons.values()):
            return _with_others(reasons, _STAYS)
        bounds = {name: self._bounds(targets[name]) for name in command.vehicles}
        moving = {name: move for name, move in self._moves.items() if name in targets}
        moves, requests = yield self._model.workers.submit(
            self._prepared, command, targets, bounds, moving, fixed, self._time()
        )
        self._moves = {**moving, **moves}
        if self._fleet(command, targets):
            calls = [requests[name][1] for name in command.vehicles]
            goals, yaws = [each.goal for each in calls], [each.yaw for each in calls]
            outcomes = yield from self._call_fleet(
                command, calls[0].duration, goals=goals, yaws=yaws
            )
            if any(outcomes.values()):
                self._moves = {n: m for n, m in self._moves.items() if n not in outcomes}
            return outcomes
        answers = {name: self._begin(self._call(command, *each)) for name, each in requests.items()}
        outcomes = yield from gathered(answers)
        gone = [targets[name] for name, text in outcomes.items() if not text]
        if 0 < len(gone) < len(outcomes):
            # The paths were checked for all vehicles together.
            self._hold(gone)
            outcomes = _with_others(outcomes, f"is held: {_STAYS}")
        return outcomes

    def _why_it_stays(self, target):
        service = _service(target, Action.GO_TO)
        if service is None:
            return _why_no_service(Action.GO_TO, target)
        if service.needs_commander:
            self._start_commander(target.vehicle)
            return "it had no services for moves; they are being started, try again in a moment"
        if target.now.position is None or target.now.is_stale:
            return "its position is not known; expected a new one"
        if "flight_status" in target.vehicle.topics and not target.now.is_in_flight:
            return f"the vehicle is {target.now.state}; expected it to fly"
        return ""

    def _prepared(self, command, targets, bounds, moving, fixed, now):
        """Return moves, and services with requests, of the vehicles; waits for the master."""
        services = {n: targets[n].vehicle.services[Action.GO_TO] for n in command.vehicles}
        graph, frames = self._model.graph, self._model.frames
        spaces = {name: _namespace(service, graph) for name, service in services.items()}
        wanted = {name: f"{each.vehicle.namespace}/{BUFFER}" for name, each in targets.items()}
        known = self._model.master.parameters(
            [
                *wanted.values(),
                *(f"{space}/{key}" for space in spaces.values() for key in (_YAW, _FIXED)),
            ]
        )
        places = {n: t.now.position for n, t in targets.items() if t.now.position is not None}
        goals = formation({name: places[name] for name in services}, command.goal)
        distance = max(math.dist(places[name], goal) for name, goal in goals.items())
        duration = max(_MIN_DURATION, distance / command.speed)
        moves = {n: Move(places[n], goal, now, duration) for n, goal in goals.items()}
        requests = {}
        for name, space in spaces.items():
            target = targets[name]
            has_yaw = known.get(f"{space}/{_YAW}", target.vehicle.has_driver)
            own = known.get(f"{space}/{_FIXED}") or frames.parent(target.now.frame) or fixed
            yaw = rpy_from_quaternion(*target.now.rotation)[2]
            yaw = yaw if command.yaw is None else command.yaw
            goal, yaw = self._in_own_frame(name, goals[name], yaw, own.strip("/"), fixed)
            _expect_inside(name, places[name], goals[name], goal, bounds[name])
            request = srv.GoToRequest(goal=Point(*goal), yaw=yaw if has_yaw else 0.0)
            request.duration = genpy.Duration.from_sec(duration)
            requests[name] = services[name], request
        buffers = {name: float(known[key]) for name, key in wanted.items() if key in known}
        expect_apart(moves, places, moving, buffers, now)
        return moves, requests

    def _in_own_frame(self, name, goal, yaw, own, fixed):
        if own == fixed:
            return goal, yaw
        place = self._model.frames.in_fixed(own, fixed)
        if place is None:
            raise RefusalError(
                f"go to: {name} is commanded in the frame {own}, and the page shows {fixed}; "
                "expected one of them above the other on /tf"
            )
        return in_frame(goal, yaw, place)

    def _hold(self, targets):
        """Hold vehicles where they are."""
        for target in targets:
            self._moves.pop(target.vehicle.name, None)
            service = target.vehicle.services[Action.GO_TO]
            self._handle.call_service(service.name, srv.GoTo, _hold_request(), _TIMEOUT)

    def _start_commander(self, vehicle):
        name = f"{vehicle.namespace}/high_level"
        running = self._commanders.get(name)
        if running is not None and running.poll() is None:
            return
        has_yaw = self._model.graph.types.get(f"{vehicle.namespace}/ref") == _YAW_REFERENCE
        self._handle.set_param_later(f"{name}/reference/yaw", has_yaw)
        (program,) = roslib.packages.find_node("crazyflie_mission_api", "high_level_node")[:1]
        # A process of its own, so that it continues when this one ends.
        arguments = [program, f"__ns:={vehicle.namespace or '/'}", "__name:=high_level"]
        self._commanders[name] = subprocess.Popen(arguments, start_new_session=True)


def expect_fresh(what: str, age: float) -> None:
    """Raise `RefusalError` for a command whose click is too old (s), or in the future."""
    if not -0.1 <= age <= MAX_COMMAND_AGE:
        raise RefusalError(
            f"{what}: the command is {age:.1f} s old; expected at most {MAX_COMMAND_AGE:g} s; "
            "nothing was done"
        )


def _with_others(outcomes: Outcomes, remark: str) -> Outcomes:
    """Return refusals, and after them a remark for each of the other vehicles."""
    refused = {name: text for name, text in outcomes.items() if text}
    return refused | {name: remark for name, text in outcomes.items() if not text}


def _check(command: Command) -> None:
    numbers = [command.height, command.speed, *(command.goal or ()), command.yaw or 0.0]
    if not all(map(math.isfinite, numbers)):
        raise RefusalError(f"{command.action.value}: {numbers}; expected finite numbers")
    if not command.vehicles:
        raise RefusalError(f"{command.action.value}: no vehicle is chosen")
    low, high = HEIGHTS
    if command.action == Action.TAKEOFF and not low <= command.height <= high:
        raise RefusalError(
            f"take off: the height is {command.height:g} m; expected {low:g} to {high:g} m"
        )
    if command.action != Action.GO_TO:
        return
    if command.goal is None:
        raise RefusalError("go to: no goal is set; expected x, y and z")
    if not 0.0 < command.speed <= _MAX_SPEED:
        raise RefusalError(
            f"go to: the speed is {command.speed:g} m/s; expected more than 0 and at most "
            f"{_MAX_SPEED:g} m/s"
        )
    if command.goal[2] < -_ROUNDING:
        raise RefusalError(f"go to: z is {command.goal[2]:g} m; expected 0 or more")


def _service(target: Target | None, action: Action) -> Service | None:
    return None if target is None else target.vehicle.services.get(action)


def _why_no_service(action: Action, target: Target | None) -> str:
    known = "there is no such vehicle" if target is None else "it has no service for it"
    return f"{action.value}: {known}"


def _namespace(service: Service, graph: Graph) -> str:
    """Return the namespace of the parameters of the node that offers a service."""
    space, _, _ = service.name.rpartition("/")
    return space if space.endswith("/high_level") else graph.services.get(service.name, space)


def _expect_inside(name: str, place: Triple, goal: Triple, own: Triple, bounds: Bounds) -> None:
    """Refuse a goal out of bounds; ``own`` is the goal in the vehicle's frame (m).

    Where there is no geofence, a vehicle that is out of bounds may go back.
    """
    # The middle of a formation at 0 may lie a rounding error below it.
    if own[2] < -_ROUNDING:
        raise RefusalError(f"go to: {name} would go to z = {own[2]:.2f} m; expected 0 or more")
    box, what, is_fence = bounds
    x = own if is_fence else goal
    for k, axis in enumerate("xyz"):
        low, high = box.lower[k], box.upper[k]
        is_back = not is_fence and min(place[k], low) <= x[k] <= max(place[k], high)
        if not (low - _ROUNDING <= x[k] <= high + _ROUNDING or is_back):
            raise RefusalError(
                f"go to: {name} would leave {what}: {axis} is {x[k]:.2f} m; expected {low:g} to "
                f"{high:g} m"
            )


def _request(command: Command, service: Service, target: Target) -> Any:
    if service.kind is Empty:
        return EmptyRequest()
    if service.kind is SetBool:
        return SetBoolRequest(command.action == Action.ARM)
    if service.kind is srv.Takeoff:
        return _takeoff_request(command, target)
    if service.kind is srv.GoTo:
        return _hold_request()
    position = target.now.position
    height = _UNKNOWN_HEIGHT if position is None else position[2]
    duration = max(_MIN_DURATION, height / _CLIMB_SPEED)
    return srv.LandRequest(0, 0.0, genpy.Duration.from_sec(duration))


def _takeoff_request(command, target):
    duration = max(_MIN_DURATION, command.height / _CLIMB_SPEED)
    if "flight_status" in target.vehicle.topics:
        duration += TAKEOFF_LEAD
    return srv.TakeoffRequest(0, command.height, genpy.Duration.from_sec(duration))


def _hold_request():
    return srv.GoToRequest(relative=True, duration=genpy.Duration.from_sec(_HOLD_DURATION))
