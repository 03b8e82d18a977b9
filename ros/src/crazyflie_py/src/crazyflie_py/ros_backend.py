"""Crazyswarm's API on vehicles that run: simulated, virtual or real ones, by ROS."""

import argparse
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rosgraph
from geometry_msgs.msg import Point
from std_msgs.msg import String
from std_srvs.srv import Empty
from typing_extensions import override

from crazyflie_driver import srv
from crazyflie_fleet.high_level_services import HIGH_LEVEL
from crazyflie_fleet.settings import RobotSettings
from crazyflie_mission_api import Fleet, MissionError
from crazyflie_mission_api.fleet import catch_signals
from crazyflie_mission_api.ros_vehicle import ALL_OF_FLEET, common_services, seconds
from crazyflie_model.angles import Triple
from crazyflie_py import fleet as fleet_files
from crazyflie_py.backend import EachVehicle, SwarmBackend, Visualizer
from crazyflie_py.ros_connection import ScriptConnection, running_vehicles
from crazyflie_py.ros_vehicle import RosVehicleBackend
from crazyflie_py.separation_watch import SeparationWatch
from crazyflie_py.visualizer import NullVisualizer
from crazyflie_utils.main import begin_script
from crazyflie_utils.process import Process

_FIND_LIMIT = 10.0  #: Timeout of the search for the vehicles of a file (s, machine's clock).
_WATCH_PERIOD = 0.05  #: Period of the checks of distances, as in a fleet (s).
_LANDING_LIMIT = 15.0  #: Timeout of landings that the script has begun, at its end (s).


class RosBackend(EachVehicle, SwarmBackend):
    """All vehicles; see `crazyflie_py.backend.SwarmBackend`.

    ``crazyflies_yaml`` says which of the vehicles that run take part, by default all do. The
    process is made, unless it is given. Without a master or vehicles, the script ends with the
    reason and status 1.
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
        ids = [v.id for v in vehicles] if vehicles else ids_of(names)
        places: list[Any] = [v.position for v in vehicles] if vehicles else [None] * len(names)
        services = handle.service_nodes()
        self._vehicles = [
            RosVehicleBackend(
                fleet.vehicle(name),
                number,
                place,
                self._connection,
                f"/{name}/update_params" in services,
            )
            for name, number, place in zip(names, ids, places, strict=True)
        ]
        self._top = common_services(services, names)
        self._watch_separation(vehicles or [])
        handle.subscribe("/fleet/waiting", String, self._on_held)

    @property
    @override
    def vehicles(self) -> Sequence[RosVehicleBackend]:
        return self._vehicles

    @property
    @override
    def visualizer(self) -> Visualizer:
        return self._visualizer

    def _watch_separation(self, configured):
        # A fleet's process keeps apart what it flies.
        watched = [vehicle for vehicle in self._vehicles if vehicle.uses_driver]
        own = {vehicle.name: vehicle.buffer for vehicle in configured}
        buffers = {**own, **self._connection.fleet.rules.buffers}
        radii = [buffers.get(vehicle.name, RobotSettings.buffer) for vehicle in watched]
        if len(watched) > 1:
            watch = SeparationWatch([vehicle.held for vehicle in watched], radii, self._connection)
            self._connection.handle.timer(_WATCH_PERIOD, lambda: self._look(watch))

    def _look(self, watch):
        # The landing at the end keeps vehicles apart itself.
        if not self._is_closed:
            watch.update()

    def _on_held(self, message):
        if message.data:
            text = f"held by the fleet, since another vehicle is too near: {message.data}"
            self._connection.handle.warn(text)

    # Commands to all.

    @override
    def take_off(self, height: float, duration: float, group_mask: int = 0) -> None:
        members = {v.name: v for v in self._vehicles if v.is_member(group_mask)}
        begun = [vehicle.has_begun for vehicle in members.values()]
        if self._top == ALL_OF_FLEET:
            # One call: a hundred of them would keep the fleet from flying.
            for vehicle in members.values():
                vehicle.check_takeoff(height)
            arguments = (group_mask, height, seconds(duration))
            self._call(
                "takeoff", srv.Takeoff, *arguments, has_begun=lambda: all(b() for b in begun)
            )
            return
        calls = {
            name: vehicle.begin_takeoff(height, duration, group_mask)
            for name, vehicle in members.items()
        }
        self._connection.finish("takeoff", calls, lambda name: members[name].has_begun())

    @override
    def land(self, height: float | None, duration: float, group_mask: int = 0) -> None:
        for vehicle in self._vehicles:
            if vehicle.is_member(group_mask):
                vehicle.held.free(duration)
        self._call("land", srv.Land, group_mask, height or 0.0, seconds(duration))
        for vehicle in self._vehicles:
            vehicle.note_landing(group_mask)

    @override
    def stop(self, group_mask: int = 0) -> None:
        self._call("stop", srv.Stop, group_mask)

    @override
    def go_to(
        self,
        goal: Triple,
        yaw: float,
        duration: float,
        relative: bool = False,
        group_mask: int = 0,
    ) -> None:
        yaw = self._vehicles[0].checked_yaw(yaw)
        self._call("go_to", srv.GoTo, group_mask, relative, Point(*goal), yaw, seconds(duration))

    @override
    def start_trajectory(
        self, trajectory_id: int, time_scale: float, reverse: bool, relative: bool, group_mask: int
    ) -> None:
        arguments = (group_mask, trajectory_id, time_scale, reverse, relative)
        self._call("start_trajectory", srv.StartTrajectory, *arguments)

    @override
    def emergency(self) -> None:
        if self._top is None:
            calls = {vehicle.name: vehicle.begin_emergency() for vehicle in self._vehicles}
        else:
            # A fleet's emergency service is not one of its high-level services.
            service = f"{self._top.removesuffix(f'/{HIGH_LEVEL}')}/emergency"
            calls = {"allcfs": self._connection.call(service, Empty)}
        self._connection.finish("emergency", calls)

    def _call(self, name, service_type, *arguments, has_begun=lambda: False):
        if self._top is None:
            calls = {v.name: v.call(name, service_type, *arguments) for v in self._vehicles}
        else:
            for vehicle in self._vehicles:
                vehicle.held.end_setpoints()
            service = f"{self._top}/{name}"
            calls = {"allcfs": self._connection.call(service, service_type, *arguments)}
        self._connection.finish(name, calls, lambda _: has_begun())

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
        vehicles = {v.name: v for v in self._vehicles if v.name in fleet.flying}
        landing = [v for v in vehicles.values() if v.held.is_landing]
        limit = fleet.time() + _LANDING_LIMIT
        fleet.clock.wait_until(lambda: all(v.has_landed() for v in landing), limit)
        for name, vehicle in vehicles.items():
            if vehicle.has_landed():
                fleet.release(name)
            else:
                # Its landing begins where it is now.
                fleet.adopt(name)
        # They land as after an error, whatever their distances.
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
            f"no ROS master at {rosgraph.get_master_uri()}, so no vehicle runs; expected, for "
            "example, roslaunch crazyflie_examples sw_swarm.launch, or the option --sim"
        )
    process, end = begin_script("crazyswarm")
    catch_signals()
    return process, end
