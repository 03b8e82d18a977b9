"""The swarm of running vehicles: simulated, virtual or real ones, over ROS."""

import argparse
import math
import re
import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path

import rosgraph
from std_msgs.msg import String
from typing_extensions import override

from crazyflie_fleet.high_level_services import HIGH_LEVEL
from crazyflie_fleet.vehicle_nodes import PLACE
from crazyflie_mission_api import Fleet, MissionError
from crazyflie_mission_api.fleet import catch_signals
from crazyflie_mission_api.mission_vehicle import never
from crazyflie_mission_api.ros_vehicle import (
    ALL_OF_FLEET,
    ServiceCommands,
    common_services,
    flown_vehicles,
)
from crazyflie_py import arguments as check
from crazyflie_py import fleet as fleet_files
from crazyflie_py.fleet import FleetVehicle
from crazyflie_py.script_vehicle import ScriptConnection, ScriptVehicle
from crazyflie_py.separation_watch import SeparationWatch
from crazyflie_py.swarm import NullVisualizer, Order, Swarm
from crazyflie_utils import NodeHandle
from crazyflie_utils.main import begin_script
from crazyflie_utils.node import Process
from crazyflie_utils.parameters.types import Integer
from crazyflie_utils.ros1.master_watch import master_answers

_SEARCH_LIMIT = 5.0  #: Timeout of the search for vehicles (s of the machine's clock).
_FIND_LIMIT = 10.0  #: Timeout of the search for the vehicles of a file (s, machine's clock).
_WATCH_PERIOD = 0.05  #: Period of the checks of distances, as in a fleet (s).
_LANDING_LIMIT = 15.0  #: Timeout of landings that the script has begun, at its end (s).

#: Commands that the services for all carry out at the same moment.
_COMMON = ("land", "stop", "go_to", "start_trajectory", "emergency")


class RosSwarm(Swarm):
    """A swarm of running vehicles.

    ``crazyflies_yaml`` selects running vehicles, by default all. The process is created unless it
    is given. Without a master or vehicles, the script ends with the reason and status 1.
    """

    vehicles: Sequence[ScriptVehicle]

    def __init__(
        self,
        crazyflies_yaml: str | Path | None,
        options: argparse.Namespace,
        process: Process | None = None,
    ):
        self.visualizer = NullVisualizer()
        self._fleet: Fleet | None = None  # Until it is complete: the script flies nothing before.
        self._rates: dict[float, float] = {}
        vehicles = None if crazyflies_yaml is None else fleet_files.load(crazyflies_yaml)
        self._end = lambda: None
        if process is None:
            process, self._end = _begin(self.close)
        self._process = process
        handle = process.handle("/crazyswarm")
        try:
            if vehicles is None:
                names = fleet_files.chosen(running_vehicles(handle))
            else:
                names = [vehicle.name for vehicle in vehicles]
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
        services = handle.service_nodes()
        self.vehicles = [
            ScriptVehicle(
                fleet.vehicle(each.name),
                each,
                self._connection,
                f"/{each.name}/update_params" in services,
            )
            for each in vehicles
        ]
        self._common: ServiceCommands | None = None
        self._shared: tuple[str, ...] = _COMMON
        if (top := common_services(services, names)) is not None:
            # A fleet's emergency service is not one of its high-level services.
            emergency = f"{top.removesuffix(f'/{HIGH_LEVEL}')}/emergency"
            self._common = ServiceCommands(handle, top, emergency)
            if top == ALL_OF_FLEET:
                # One call: a hundred calls would delay the fleet's callbacks.
                self._shared = ("takeoff", *_COMMON)
        self._watch_separation()
        handle.subscribe("/fleet/waiting", String, self._on_held)
        self._fleet = fleet

    def _watch_separation(self):
        # A fleet's process keeps its own vehicles apart.
        watched = [each for each in self.vehicles if each.vehicle.uses_driver]
        buffers = self._connection.fleet.rules.buffers
        radii = [buffers.get(each.name, each.config.buffer) for each in watched]
        if len(watched) > 1:
            watch = SeparationWatch(watched, radii, self._connection)
            self._connection.handle.timer(_WATCH_PERIOD, lambda: self._look(watch))

    def _look(self, watch):
        # The landing at the end keeps the vehicles apart.
        if not self._connection.fleet.ending.is_over():
            watch.update()

    def _on_held(self, message):
        if message.data:
            text = f"held by the fleet, since another vehicle is too near: {message.data}"
            self._connection.handle.warn(text)

    # Commands.

    @override
    def command(self, order: Order, vehicle: ScriptVehicle | None) -> None:
        chosen = self.vehicles if vehicle is None else [vehicle]
        members = chosen
        if vehicle is None:
            members = [each for each in chosen if each.is_member(order.group_mask)]
        is_takeoff, is_emergency = order.name == "takeoff", order.name == "emergency"
        ending = self._connection.fleet.ending
        with nullcontext() if is_emergency else ending.commanding():
            for each in members:
                each.prepare(order)
            if not is_emergency:
                for each in chosen:
                    each.end_setpoints()
            called = {each.name: [each] for each in (members if is_takeoff else chosen)}
            if vehicle is None and self._common is not None and order.name in self._shared:
                called = {"allcfs": [*members]}
                calls = {"allcfs": order.send(self._common)}
            else:
                calls = {name: order.send(each.vehicle) for name, (each,) in called.items()}

        def has_begun(name):
            return is_takeoff and all(each.has_begun() for each in called[name])

        self._connection.finish(order.name, calls, has_begun)
        if order.name == "land":
            for each in chosen:
                each.note_landing(order.group_mask)

    # Time.

    @override
    def time(self) -> float:
        return self._connection.fleet.time()

    @override
    def sleep(self, duration: float) -> None:
        duration = check.number("timeHelper.sleep", "duration", duration)
        clock = self._connection.fleet.clock
        clock.wait_until(never, clock.time() + duration)

    @override
    def sleepForRate(self, rateHz: float) -> None:
        rate = check.rate(rateHz)
        now = self.time()
        wake = max(self._rates.get(rate, now) + 1.0 / rate, now)
        self.sleep(wake - now)
        self._rates[rate] = wake

    @override
    def isShutdown(self) -> bool:
        return self._process.exit_status is not None

    # End.

    @override
    def close(self) -> None:
        if self._fleet is not None:
            self._fleet.ending.run(self._land)

    def _land(self):
        fleet = self._connection.fleet
        vehicles = [each for each in self.vehicles if each.name in fleet.flying]
        landing = [each for each in vehicles if each.is_landing]
        limit = fleet.time() + _LANDING_LIMIT
        try:
            fleet.clock.wait_until(lambda: all(v.vehicle.has_landed() for v in landing), limit)
            for each in vehicles:
                if each.vehicle.has_landed():
                    fleet.release(each.name)
                else:
                    # The landing begins at the present position.
                    fleet.adopt(each.name)
            # The vehicles land as after an error, whatever their distances.
            fleet.land_at_end(RuntimeError, None)
        except MissionError as error:
            self._connection.handle.error(str(error))
        finally:
            self._end()


def running_vehicles(handle: NodeHandle) -> list[str]:
    """Return the names of the running vehicles: in the order of their fleet file, then by number.

    `MissionError`: no vehicle is running.
    """
    end = time.monotonic() + _SEARCH_LIMIT
    while time.monotonic() < end:
        if names := flown_vehicles(handle.service_nodes()).keys() - {"/"}:
            places = {
                name: handle.get_param(f"/{name}/{PLACE}", Integer(0, 1000), 1000) for name in names
            }
            return sorted(names, key=lambda name: (places[name], _number_key(name)))
        time.sleep(0.1)
    raise MissionError(
        f"no vehicle is running: for {_SEARCH_LIMIT:g} s there was no service "
        f"/NAME/{HIGH_LEVEL}/go_to "
        "or /NAME/upload_trajectory; expected, for example, roslaunch crazyflie_examples "
        "sw_swarm.launch, or a vehicle of crazyflie_driver; or the option --sim"
    )


def _number_key(name):
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def ids_of(names: list[str]) -> list[int]:
    """Return ids of vehicles: the numbers at the end of their names, or 1, 2, ..."""
    numbers = [re.search(r"\d+$", name) for name in names]
    ids = [int(match[0]) for match in numbers if match]
    if len(set(ids)) == len(names):
        return ids
    return list(range(1, len(names) + 1))


def _begin(close):
    if not master_answers():
        sys.exit(
            f"no ROS master at {rosgraph.get_master_uri()}, so no vehicle is running; expected, "
            "for example, roslaunch crazyflie_examples sw_swarm.launch, or the option --sim"
        )
    process, end = begin_script("crazyswarm", close)
    catch_signals(close)
    return process, end
