"""ROS interface of simulated vehicles that are added and removed, each a process of roslaunch."""

import itertools
import math
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Container
from concurrent.futures import Future
from dataclasses import dataclass, field

from typing_extensions import override

from crazyflie_tutorial_msgs.srv import (
    RemoveVehicle,
    RemoveVehicleResponse,
    SpawnVehicle,
    SpawnVehicleResponse,
)
from crazyflie_utils import Node, NodeHandle, Parameters, ServiceError, parameter
from crazyflie_utils.parameters.types import FRAME, SERVICE, TEXT, TIME_STEP, Number, Text
from crazyflie_utils.refusal import RefusalError

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def vehicle_name(wanted: str, taken: Container[str]) -> str:
    """Return the name of a vehicle, its namespace and its tf frame.

    By default it is the first free name of crazyflie1, crazyflie2, ... `RefusalError`: the
    requested text is not a name, or another vehicle has it.
    """
    if not wanted:
        return next(name for k in itertools.count(1) if (name := f"crazyflie{k}") not in taken)
    if not _NAME.fullmatch(wanted):
        raise RefusalError(
            f"{wanted!r} is not a name of a vehicle; expected letters, digits and underscores, the "
            "first a letter"
        )
    if wanted in taken:
        raise RefusalError(f"the vehicle {wanted} exists already")
    return wanted


END_LIMIT = 15.0  #: Time after which nodes that roslaunch has not ended are killed (s).


class VehicleProcess:
    """A vehicle that is started, with arguments of roslaunch, when the object is created."""

    def __init__(self, arguments: list[str]):
        # A session of its own: its nodes receive Ctrl-C only from `end`, and are killed together.
        self._process = subprocess.Popen(
            ["roslaunch", *arguments], stdin=subprocess.DEVNULL, start_new_session=True
        )
        self._deadline: float | None = None

    @property
    def status(self) -> int | None:
        """Exit status of roslaunch, None while it runs; it is killed if `end` had no effect."""
        status = self._process.poll()
        if status is None and self._deadline is not None and time.monotonic() > self._deadline:
            os.killpg(self._process.pid, signal.SIGKILL)
            status = self._process.wait()
        return status

    def end(self) -> None:
        """Ask roslaunch to end the vehicle; return at once."""
        if self._deadline is None and self._process.poll() is None:
            self._deadline = time.monotonic() + END_LIMIT
            self._process.send_signal(signal.SIGINT)


PERIOD = 0.2  #: Period of the checks of the vehicles (s of the machine's clock).


class SpawnerParameters(Parameters):
    """Parameters of `SpawnerNode`."""

    spawn_service: str = parameter(SERVICE, "service that adds a vehicle", "spawn", "srv/spawn")
    remove_service: str = parameter(
        SERVICE, "service that removes a vehicle", "remove", "srv/remove"
    )
    vehicle: str = parameter(
        Text(may_be_empty=True), "name of a vehicle that is spawned at the start, at (0, 0)", ""
    )
    package: str = parameter(
        TEXT, "package of the launch file", "crazyflie_spawner", "launch/package"
    )
    file: str = parameter(
        TEXT, "launch file that starts a vehicle", "vehicle.launch", "launch/file"
    )
    fixed_frame: str = parameter(FRAME, "tf frame of the world", "world", "frames/fixed")
    simulator_dt: float = parameter(TIME_STEP, "node class of the simulators", 0.01)
    start_limit: float = parameter(
        Number("s", above=0.0), "time after which a vehicle that is not ready is removed", 30.0
    )


@dataclass
class SpawnedVehicle:
    """A vehicle that was spawned."""

    process: VehicleProcess
    ticks_left: int  #: Number of timer periods until it must be ready.
    spawning: "Future[SpawnVehicleResponse]"  #: Reply of the spawn service.
    #: Replies of the remove service.
    removing: "list[Future[RemoveVehicleResponse]]" = field(default_factory=list)


class SpawnerNode(Node[SpawnerParameters]):
    """Start and end simulated vehicles, each in a namespace of its own, by service."""

    sources = "processes"

    #: ``start_process(arguments of roslaunch)`` returns a `VehicleProcess`.
    start_process: Callable[[list[str]], VehicleProcess] = VehicleProcess

    def __init__(self) -> None:
        self._vehicles: dict[str, SpawnedVehicle] = {}

    @override
    def register_callbacks(self, handle: NodeHandle) -> None:
        parameters = self._parameters
        handle.advertise_service(parameters.spawn_service, SpawnVehicle, self._on_spawn)
        handle.advertise_service(parameters.remove_service, RemoveVehicle, self._on_remove)
        handle.timer(PERIOD, self._on_timer, steady=True)
        if parameters.vehicle:
            self._spawn(vehicle_name(parameters.vehicle, ()), 0.0, 0.0)

    @override
    def shutdown(self) -> None:
        """End all vehicles."""
        for vehicle in self._vehicles.values():
            vehicle.process.end()

    def _on_spawn(self, request):
        name = vehicle_name(request.name, self._vehicles)
        if not (math.isfinite(request.x) and math.isfinite(request.y)):
            place = f"({request.x:g}, {request.y:g})"
            raise ServiceError(f"the position is {place}; expected finite numbers (m)")
        if self._takeoff(name) in self._handle.service_nodes():
            raise ServiceError(f"the vehicle {name} exists already, and was not spawned here")
        return self._spawn(name, request.x, request.y)

    def _spawn(self, name, x, y):
        parameters = self._parameters
        arguments = {
            "name": name,
            "x": f"{x:.9g}",
            "y": f"{y:.9g}",
            "fixed_frame": parameters.fixed_frame,
            "simulator_dt": f"{parameters.simulator_dt:.9g}",
            "sim_time": str(self._handle.uses_sim_time).lower(),
        }
        process = type(self).start_process(
            [parameters.package, parameters.file, *(f"{k}:={v}" for k, v in arguments.items())]
        )
        future: Future[SpawnVehicleResponse] = Future()
        self._vehicles[name] = SpawnedVehicle(
            process, math.ceil(parameters.start_limit / PERIOD), future
        )
        return future

    def _on_remove(self, request):
        vehicle = self._vehicles.get(request.name)
        if vehicle is None:
            known = ", ".join(sorted(self._vehicles)) or "none"
            raise ServiceError(
                f"no vehicle {request.name!r} was spawned; spawned vehicles: {known}"
            )
        future: Future[RemoveVehicleResponse] = Future()
        vehicle.removing.append(future)
        vehicle.process.end()
        return future

    def _on_timer(self):
        services = None
        for name, vehicle in list(self._vehicles.items()):
            status = vehicle.process.status
            if status is not None:
                self._forget(name, status)
            elif not vehicle.spawning.done() and not vehicle.removing:
                services = self._handle.service_nodes() if services is None else services
                self._check_ready(name, vehicle, services)

    def _check_ready(self, name, vehicle, services):
        vehicle.ticks_left -= 1
        if self._takeoff(name) in services:
            vehicle.spawning.set_result(SpawnVehicleResponse(name))
            self._handle.info(f"{name} is ready")
        elif vehicle.ticks_left <= 0:
            limit = self._parameters.start_limit
            vehicle.spawning.set_exception(
                ServiceError(f"{name} was not ready after {limit:g} s, and is removed")
            )
            # No caller waits for this removal, but the vehicle has not ended by itself.
            vehicle.removing.append(Future())
            vehicle.process.end()

    def _forget(self, name, status):
        vehicle = self._vehicles.pop(name)
        if not vehicle.spawning.done():
            vehicle.spawning.set_exception(
                ServiceError(f"{name} ended before it was ready (status {status}); see its log")
            )
        if vehicle.removing:
            self._handle.info(f"{name} was removed")
        else:
            self._handle.warn(f"{name} has ended by itself (status {status})")
        for future in vehicle.removing:
            future.set_result(RemoveVehicleResponse())

    def _takeoff(self, name):
        return self._handle.resolve(f"/{name}/takeoff")
