"""Commands of the operator become calls of services."""

import math
import subprocess
from collections.abc import Callable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import Any

import genpy
import roslib.packages
from geometry_msgs.msg import Point
from std_srvs.srv import Empty, EmptyRequest, SetBool, SetBoolRequest

from crazyflie_dashboard.answers import any_of, failed, gathered, settle
from crazyflie_dashboard.discovery import Graph, Request, Service, Vehicle
from crazyflie_dashboard.page_data import (
    MAX_COMMAND_AGE,
    Command,
    Outcome,
)
from crazyflie_dashboard.snapshot import Action, VehicleSnapshot
from crazyflie_driver import srv
from crazyflie_model.angles import rpy_from_quaternion
from crazyflie_utils import NodeHandle
from crazyflie_utils.parameters.types import BOOLEAN
from crazyflie_utils.refusal import RefusalError

_FLIGHT_TIMEOUT = 60.0  #: Of services that answer when the vehicle flies or has landed, s.
_TIMEOUT = 10.0  #: Of the others, s.
_CLIMB_SPEED = 0.5  #: Mean speed of a takeoff, m/s.
_UNKNOWN_HEIGHT = 1.0  #: From which a vehicle lands whose position is not known, m.
_MIN_DURATION = 1.0  #: Of a move, s.
_MAX_SPEED = 2.0  #: m/s.

_YAW_REFERENCE = "crazyflie_msgs/PositionVelocityYawStateStamped"

_TYPES = {
    Request.EMPTY: Empty,
    Request.SET_BOOL: SetBool,
    Request.TAKEOFF: srv.Takeoff,
    Request.LAND: srv.Land,
    Request.GO_TO: srv.GoTo,
}


@dataclass(frozen=True)
class Target:
    """A vehicle that is commanded, and what is known of it now."""

    vehicle: Vehicle
    now: VehicleSnapshot


class Actions:
    """Calls services for commands.

    Parameters
    ----------
    handle : NodeHandle
    workers : concurrent.futures.Executor
        Its threads may wait for the master.
    time : callable
        time.monotonic.
    """

    def __init__(self, handle: NodeHandle, workers: Executor, time: Callable[[], float]):
        self._handle, self._workers, self._time = handle, workers, time
        self._commanders: dict[str, subprocess.Popen[bytes]] = {}

    def carry_out(
        self, command: Command, targets: Mapping[str, Target], graph: Graph
    ) -> "Future[tuple[Outcome, ...]]":
        """Call the services that a command needs; the outcomes come when all have answered.

        Raises
        ------
        RefusalError
            The command is too old, or makes no sense.
        """
        expect_fresh(command.action.value, self._time() - command.clicked)
        _check(command)
        answers = self._land_all(command, targets, graph)
        for name in command.vehicles:
            if name not in answers:
                answers[name] = self._command(command, targets.get(name), name, graph)
        return gathered(answers)

    def close(self) -> None:
        """End the commanders that were started here; each lives until its vehicle has landed."""
        for process in self._commanders.values():
            process.terminate() if process.poll() is None else None

    def _land_all(self, command, targets, graph):
        """Return the answer of the fleet for its vehicles: it lands them in rounds."""
        node = graph.services.get("/all/land")
        if command.action != Action.LAND or set(command.vehicles) < set(targets) or node is None:
            return {}
        own = [
            name
            for name, target in targets.items()
            if any(graph.services.get(s.name) == node for s in _services(target, Action.LAND))
        ]
        if len(own) < 2:
            return {}
        answer = self._call(command, Service("/all/land", Request.EMPTY), None)
        return dict.fromkeys(own, answer)

    def _command(self, command, target, name, graph):
        services = () if target is None else _services(target, command.action)
        if not services:
            known = "there is no such vehicle" if target is None else "it has no service for it"
            return failed(f"{command.action.value}: {known}")
        if any(each.needs_commander for each in services):
            self._start_commander(target.vehicle, graph)
            return failed(
                f"{name} had no services for moves; they are being started, try again in a moment"
            )
        may_move = Action.GO_TO in (command.action, *target.now.actions)
        if command.action == Action.TAKEOFF and may_move:
            go_to = _services(target, Action.GO_TO)
            if any(each.needs_commander for each in go_to):
                self._start_commander(target.vehicle, graph)
        answers = [self._call(command, service, target) for service in services]
        return answers[0] if len(answers) == 1 else any_of(answers)

    def _call(self, command: Command, service: Service, target: Target | None) -> "Future[Any]":
        """Call a service unless the command grows too old before it is reached."""
        outcome: Future[Any] = Future()
        limit = _FLIGHT_TIMEOUT if command.action in (Action.TAKEOFF, Action.LAND) else _TIMEOUT

        def call(has_yaw):
            try:
                age = self._time() - command.clicked
                expect_fresh(command.action.value, age)
                request = _request(command, service, target, has_yaw.result())
            except Exception as error:
                outcome.set_exception(error)
                return
            # What is not reached is withdrawn: it must not be carried out when the node goes on.
            answer = self._handle.call_service(
                service.name, _TYPES[service.request], request, limit, MAX_COMMAND_AGE - age
            )
            answer.add_done_callback(lambda done: settle(done, outcome))

        if service.request == Request.GO_TO:
            has_yaw = f"{service.name.rpartition('/')[0]}/reference/yaw"
            found = self._workers.submit(
                self._handle.get_param, has_yaw, BOOLEAN, _is_drivers(target)
            )
            found.add_done_callback(lambda done: self._handle.submit(call, done))
        else:
            known: Future[bool] = Future()
            known.set_result(False)
            call(known)
        return outcome

    def _start_commander(self, vehicle, graph):
        name = vehicle.commander
        running = self._commanders.get(name)
        if running is not None and running.poll() is None:
            return
        has_yaw = graph.types.get(f"{vehicle.namespace}/ref") == _YAW_REFERENCE
        self._handle.set_param_later(f"{name}/reference/yaw", has_yaw)
        (program,) = roslib.packages.find_node("crazyflie_mission_api", "high_level_node")[:1]
        # A process of its own, so that the vehicle keeps it when this one ends.
        arguments = [program, f"__ns:={vehicle.namespace or '/'}", "__name:=high_level"]
        self._commanders[name] = subprocess.Popen(arguments, start_new_session=True)


def expect_fresh(what: str, age: float) -> None:
    """Raise `RefusalError` for a command whose click is too old, s, or not yet."""
    if not -0.1 <= age <= MAX_COMMAND_AGE:
        raise RefusalError(
            f"{what}: the command is {age:.1f} s old; expected at most {MAX_COMMAND_AGE:g} s; "
            "nothing was done"
        )


def _check(command: Command) -> None:
    numbers = [command.height, command.speed, *(command.goal or ()), command.yaw or 0.0]
    if not all(map(math.isfinite, numbers)):
        raise RefusalError(f"{command.action.value}: {numbers}; expected finite numbers")
    if not command.vehicles:
        raise RefusalError(f"{command.action.value}: no vehicle is chosen")
    if command.action != Action.GO_TO:
        return
    if command.goal is None or len(command.vehicles) != 1:
        raise RefusalError("go to: expected one vehicle and one goal")
    if not 0.0 < command.speed <= _MAX_SPEED:
        raise RefusalError(
            f"go to: the speed is {command.speed:g} m/s; expected more than 0 and at most "
            f"{_MAX_SPEED:g} m/s"
        )
    if command.goal[2] < 0.0:
        raise RefusalError(f"go to: z is {command.goal[2]:g} m; expected 0 or more")


def _services(target: Target, action: Action) -> tuple[Service, ...]:
    return target.vehicle.services.get(action, ())


def _is_drivers(target):
    return target is not None and target.vehicle.has_driver


def _request(command: Command, service: Service, target: Target | None, has_yaw: bool) -> Any:
    if service.request == Request.EMPTY:
        return EmptyRequest()
    if service.request == Request.SET_BOOL:
        return SetBoolRequest(command.action == Action.ARM)
    if service.request == Request.TAKEOFF:
        duration = max(_MIN_DURATION, command.height / _CLIMB_SPEED)
        return srv.TakeoffRequest(0, command.height, genpy.Duration.from_sec(duration))
    assert target is not None
    position = target.now.position
    if service.request == Request.LAND:
        height = _UNKNOWN_HEIGHT if position is None else position[2]
        duration = max(_MIN_DURATION, height / _CLIMB_SPEED)
        return srv.LandRequest(0, 0.0, genpy.Duration.from_sec(duration))
    assert command.goal is not None
    if position is None or target.now.is_stale:
        raise RefusalError(f"{target.vehicle.name}: its position is not known; expected a new one")
    heading = rpy_from_quaternion(*target.now.rotation)[2] if has_yaw else 0.0
    duration = max(_MIN_DURATION, math.dist(position, command.goal) / command.speed)
    return srv.GoToRequest(
        groupMask=0,
        relative=False,
        goal=Point(*command.goal),
        yaw=heading if command.yaw is None else command.yaw,
        duration=genpy.Duration.from_sec(duration),
    )
