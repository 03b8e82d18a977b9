"""The swarm of running vehicles: simulated, virtual or real ones, by ROS."""

import argparse
import math
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import rosgraph
from std_msgs.msg import String
from typing_extensions import override

from crazyflie_fleet.high_level_services import HIGH_LEVEL
from crazyflie_mission_api import Fleet, MissionError
from crazyflie_mission_api.fleet import catch_signals
from crazyflie_mission_api.mission_vehicle import Setpoint
from crazyflie_mission_api.ros_vehicle import ALL_OF_FLEET, ServiceCommands, common_services
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_py import fleet as fleet_files
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.ros_connection import ScriptConnection, running_vehicles
from crazyflie_py.script_vehicle import ScriptVehicle
from crazyflie_py.separation_watch import SeparationWatch
from crazyflie_py.swarm import NullVisualizer, Order, ParameterStore, ScriptState, Swarm
from crazyflie_utils.main import begin_script
from crazyflie_utils.node import Process

_FIND_LIMIT = 10.0  #: Timeout of the search for the vehicles of a file (s, machine's clock).
_WATCH_PERIOD = 0.05  #: Period of the checks of distances, as in a fleet (s).
_LANDING_LIMIT = 15.0  #: Timeout of landings that the script has begun, at its end (s).

#: Commands that the services for all carry out at the same moment.
_COMMON = ("land", "stop", "go_to", "start_trajectory", "emergency")


class RosSwarm(Swarm):
    """A `crazyflie_py.swarm.Swarm` of running vehicles.

    ``crazyflies_yaml`` selects running vehicles, by default all. The process is created unless it
    is given. Without a master or vehicles, the script ends with the reason and status 1.
    """

    dt = 0.0

    def __init__(
        self,
        crazyflies_yaml: str | Path | None,
        options: argparse.Namespace,
        process: Process | None = None,
    ):
        self._visualizer = NullVisualizer()
        self._is_closed = False
        self._rates: dict[float, float] = {}
        vehicles = None if crazyflies_yaml is None else fleet_files.load(crazyflies_yaml)
        self._end = lambda: None
        if process is None:
            process, self._end = _begin()
        self._process = process
        handle = process.handle("/crazyswarm")
        try:
            names = [v.name for v in vehicles] if vehicles else running_vehicles(handle)
            names = fleet_files.chosen(names)
            vehicles = vehicles and [each for each in vehicles if each.name in names]
            fleet = Fleet(names, startup_timeout=_FIND_LIMIT, process=process)
        except (MissionError, ValueError) as error:
            self._end()
            sys.exit(str(error))
        self._connection = ScriptConnection(handle, fleet, options.unchecked)
        if vehicles is None:
            places = [fleet.vehicle(name).position() or (math.nan,) * 3 for name in names]
            vehicles = [
                FleetVehicle(*each) for each in zip(names, ids_of(names), places, strict=True)
            ]
        self._fleet = vehicles
        services = handle.service_nodes()
        self._vehicles = {
            each.name: ScriptVehicle(
                fleet.vehicle(each.name),
                each,
                self._connection,
                f"/{each.name}/update_params" in services,
            )
            for each in vehicles
        }
        self._common: ServiceCommands | None = None
        self._shared: tuple[str, ...] = _COMMON
        if (top := common_services(services, names)) is not None:
            paths = {name: f"{top}/{name}" for name in ("takeoff", *_COMMON)}
            # A fleet's emergency service is not one of its high-level services.
            paths["emergency"] = f"{top.removesuffix(f'/{HIGH_LEVEL}')}/emergency"
            self._common = ServiceCommands(handle, paths)
            if top == ALL_OF_FLEET:
                # One call: a hundred calls would delay the fleet's callbacks.
                self._shared = ("takeoff", *_COMMON)
        self._watch_separation()
        handle.subscribe("/fleet/waiting", String, self._on_held)

    @property
    @override
    def fleet(self) -> Sequence[FleetVehicle]:
        return self._fleet

    @property
    @override
    def visualizer(self) -> NullVisualizer:
        return self._visualizer

    @property
    @override
    def parameters(self) -> dict[str, ParameterStore]:
        return {name: vehicle.parameters for name, vehicle in self._vehicles.items()}

    def _watch_separation(self):
        # A fleet's process keeps its own vehicles apart.
        watched = [each for each in self._fleet if self._vehicles[each.name].vehicle.uses_driver]
        buffers = self._connection.fleet.rules.buffers
        radii = [buffers.get(each.name, each.buffer) for each in watched]
        if len(watched) > 1:
            held = [self._vehicles[each.name].held for each in watched]
            watch = SeparationWatch(held, radii, self._connection)
            self._connection.handle.timer(_WATCH_PERIOD, lambda: self._look(watch))

    def _look(self, watch):
        # The landing at the end keeps the vehicles apart.
        if not self._is_closed:
            watch.update()

    def _on_held(self, message):
        if message.data:
            text = f"held by the fleet, since another vehicle is too near: {message.data}"
            self._connection.handle.warn(text)

    # Commands.

    def _chosen(self, name: str | None) -> list[ScriptVehicle]:
        return [*self._vehicles.values()] if name is None else [self._vehicles[name]]

    @override
    def command(self, order: Order, name: str | None) -> None:
        chosen = self._chosen(name)
        members = chosen
        if name is None:
            members = [each for each in chosen if each.is_member(order.group_mask)]
        for each in members:
            each.prepare(order)
        is_takeoff = order.name == "takeoff"
        if order.name != "emergency":
            for each in chosen:
                each.held.end_setpoints()
        if name is None and self._common is not None and order.name in self._shared:
            calls = {"allcfs": order.send(self._common)}
        else:
            called = members if is_takeoff else chosen
            calls = {each.name: order.send(each.vehicle) for each in called}

        def has_begun(called):
            begun = members if called == "allcfs" else [self._vehicles[called]]
            return is_takeoff and all(each.has_begun() for each in begun)

        self._connection.finish(order.name, calls, has_begun)
        if order.name == "land":
            for each in chosen:
                each.note_landing(order.group_mask)

    @override
    def send(self, setpoint: Setpoint, name: str | None) -> None:
        for each in self._chosen(name):
            each.send(setpoint)

    @override
    def set_group_mask(self, group_mask: int, name: str) -> None:
        self._vehicles[name].groups = group_mask

    @override
    def checked_yaw(self, yaw: float, name: str | None) -> float:
        return self._chosen(name)[0].checked_yaw(yaw)

    @override
    def checked_pieces(self, pieces: list[PolynomialPiece], name: str) -> list[PolynomialPiece]:
        check = self._vehicles[name].checked_yaw
        return [
            replace(piece, yaw=[check(value) for value in piece.yaw]) if any(piece.yaw) else piece
            for piece in pieces
        ]

    @override
    def avoid(self, name: str, others: Sequence[str], settings: AvoidanceSettings | None) -> None:
        self._vehicles[name].avoid(settings)

    @override
    def state(self, name: str) -> ScriptState:
        return self._vehicles[name].states.state()

    @override
    def status(self, name: str) -> dict[str, Any]:
        return self._vehicles[name].status()

    # Time.

    @override
    def time(self) -> float:
        return self._connection.fleet.time()

    @override
    def sleep(self, duration: float) -> None:
        self._connection.sleep(duration)

    @override
    def sleep_for_rate(self, rate: float) -> None:
        now = self.time()
        wake = max(self._rates.get(rate, now) + 1.0 / rate, now)
        self._connection.sleep(wake - now)
        self._rates[rate] = wake

    @override
    def is_shutdown(self) -> bool:
        return self._process.exit_status is not None

    @override
    def next_phase(self) -> None:
        pass

    # End.

    @override
    def close(self) -> None:
        if self._is_closed:
            return
        self._is_closed = True
        try:
            self._land()
        except MissionError as error:
            self._connection.handle.error(str(error))
        finally:
            self._end()

    def _land(self):
        fleet = self._connection.fleet
        vehicles = {name: self._vehicles[name] for name in fleet.flying}
        landing = [v for v in vehicles.values() if v.held.is_landing]
        limit = fleet.time() + _LANDING_LIMIT
        fleet.clock.wait_until(lambda: all(v.vehicle.has_landed() for v in landing), limit)
        for name, vehicle in vehicles.items():
            if vehicle.vehicle.has_landed():
                fleet.release(name)
            else:
                # The landing begins at the present position.
                fleet.adopt(name)
        # The vehicles land as after an error, whatever their distances.
        fleet.__exit__(RuntimeError, None, None)


def ids_of(names: list[str]) -> list[int]:
    """Return ids of vehicles: the numbers at the end of their names, or 1, 2, ..."""
    numbers = [re.search(r"\d+$", name) for name in names]
    ids = [int(match[0]) for match in numbers if match]
    if len(set(ids)) == len(names):
        return ids
    return list(range(1, len(names) + 1))


def _begin():
    if not rosgraph.is_master_online():
        sys.exit(
            f"no ROS master at {rosgraph.get_master_uri()}, so no vehicle is running; expected, "
            "for example, roslaunch crazyflie_examples sw_swarm.launch, or the option --sim"
        )
    process, end = begin_script("crazyswarm")
    catch_signals()
    return process, end
