"""Groups of simulated, virtual and real vehicles, over ROS."""

import contextlib
import math
import re
import signal
import sys
import threading
import time
import uuid
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import rosgraph
from std_msgs.msg import String
from typing_extensions import override

from crazyflie_fleet import fleet_file
from crazyflie_fleet.fleet_config import BUFFER
from crazyflie_fleet.fleet_parameters import NODE_PARAMETERS
from crazyflie_fleet.high_level_node import HighLevelNode
from crazyflie_fleet.high_level_services import HIGH_LEVEL, START_TOPIC
from crazyflie_fleet.mission_watch import MISSION_PERIOD, MISSION_TOPIC, Claim, MissionWatch
from crazyflie_fleet.vehicle_nodes import OBSTACLES
from crazyflie_mission_api import observer
from crazyflie_mission_api.dry_run import dry_run
from crazyflie_mission_api.group_state import Obstacle, Rules
from crazyflie_mission_api.limits import EVERYWHERE, Bounds, Limits, MissionError
from crazyflie_mission_api.mission_vehicle import Clock, Playback, done
from crazyflie_mission_api.ros_vehicle import (
    ALL_OF_FLEET,
    Access,
    PoseAgeLimit,
    RosVehicle,
    RosVehicleState,
    ServiceCommands,
    common_services,
    flown_vehicles,
    prefix,
)
from crazyflie_mission_api.script_end import ScriptEnd
from crazyflie_mission_api.vehicle_group import VehicleGroup
from crazyflie_utils import NodeHandle, ParameterError, TransformError
from crazyflie_utils.main import begin_script
from crazyflie_utils.node import Process
from crazyflie_utils.parameters.types import BOOLEAN, FRAME, Number
from crazyflie_utils.timers import Timer

_FROZEN = 10.0  #: Longest time that /clock may stand still (s of the machine's clock).

#: Longest time to wait for messages of all missions at the start (s of the machine's clock): killed
#: missions, whose nodes are still registered with the master, send none.
_MISSIONS_LIMIT = 1.0

_OBSTACLE_LIMIT = 1.0  #: Timeout for positions of other missions' vehicles (s, machine's clock).

_POLL = 0.2  #: Period of the search for vehicles (s).

_YAW_STATE = "crazyflie_msgs/PositionVelocityYawStateStamped"


class RosClock(Clock):
    """The time of a process, real or simulated.

    ``has_ended()`` is whether the thread that waits must not command vehicles any more.
    """

    def __init__(self, handle: NodeHandle, has_ended: Callable[[], bool]):
        self._handle = handle
        self._has_ended = has_ended
        self._tick = threading.Event()
        handle.timer(0.02, self._tick.set)

    @override
    def time(self) -> float:
        return self._handle.time()

    @override
    def wait_until(self, condition: Callable[[], bool], deadline: float) -> bool:
        last, moved_at = self.time(), time.monotonic()
        while not (done := condition()) and (now := self.time()) < deadline:
            if self._has_ended():
                raise MissionError("ROS shuts down before the end of the mission")
            if now != last:
                last, moved_at = now, time.monotonic()
            elif time.monotonic() - moved_at > _FROZEN:
                raise MissionError(f"no /clock for {_FROZEN:g} s; is the simulation running?")
            self._tick.wait(0.1)
            self._tick.clear()
        return done


class Fleet(VehicleGroup):
    """The vehicles of a mission on the ROS graph.

    A vehicle ``NAME`` is flown by the services that it offers: those of a `HighLevelNode`,
    ``/NAME/high_level/go_to`` and so on; or the driver's, ``/NAME/go_to``; or, where there is
    only a takeoff server, by a `HighLevelNode` in this process. ``"/"`` is a vehicle without a
    namespace. Use it in a with block; at the end of the block, all vehicles land. When ROS shuts
    down before, as after ``rospy.spin()`` and Ctrl-C, they land while services still answer.

    Parameters
    ----------
    names : sequence of str, or str or Path
        Names of vehicles; or a fleet file (see `crazyflie_fleet.fleet_file`), NAME.yaml.
    bounds : Bounds, optional
        Box that they may fly in; a vehicle's geofence limits it, too.
    limits : Limits, optional
        Of trajectories.
    separation, tolerance, arrival_timeout : float
        See `Rules`.
    startup_timeout : float
        Longest time until all vehicles are found, s of the machine's clock.
    process : Process, optional
        By default this script is made a node, unless it is one. Whoever gives a process calls
        `land_at_end` when it shuts down.

    Raises
    ------
    MissionError
        A vehicle was not found (the text says what was searched for), or belongs to another running
        mission.
    """

    def __init__(
        self,
        names: str | Path | Sequence[str],
        bounds: Bounds = EVERYWHERE,
        limits: Limits | None = None,
        separation: float = 0.3,
        tolerance: float = 0.15,
        arrival_timeout: float = 15.0,
        startup_timeout: float = 30.0,
        process: Process | None = None,
    ):
        chosen, buffers = vehicles_of(names)
        self._end: Callable[[], None] = lambda: None
        #: See `ScriptEnd`.
        self.ending = ScriptEnd(lambda: process is not None and process.exit_status is not None)
        # ROS may be shut down from now on: nothing flies yet.
        self._vehicles, self._commanded = {}, {}
        self._heartbeat: Timer | None = None
        if process is None:
            process, self._end = begin_script("mission", partial(self._end_early, "ROS shuts down"))
            catch_signals(partial(self._end_early, "a second signal"))
        self._handle = process.handle("/mission")
        self._mission = f"{_program()}_{uuid.uuid4().hex[:8]}"
        self._missions = MissionWatch(self._handle, own=self._mission)
        self._others: dict[str, RosVehicleState] = {}
        self._max_age = PoseAgeLimit(self._handle)
        try:
            vehicles, common = _connect(
                process, self._handle, self._max_age, chosen, startup_timeout
            )
            # Commands to all vehicles of a driver, if they are exactly these.
            self._driver: ServiceCommands | None = None
            if common not in (None, ALL_OF_FLEET):
                self._driver = ServiceCommands(self._handle, common)
            self._starts = self._handle.publisher(START_TOPIC, String)
            clock = RosClock(self._handle, self.ending.is_over)
            # The buffers of the fleet process that flies them, if one does.
            watched = {name: _buffer(self._handle, name) for name in chosen}
            buffers |= {name: max(b, buffers.get(name, b)) for name, b in watched.items() if b}
            rules = Rules(
                limits or Limits(), bounds, separation, tolerance, arrival_timeout, buffers
            )
            super().__init__(vehicles, clock, rules)
            self.observer = observer.of_process
            self.obstacles = self._find_obstacles
            self._buffers = buffers
            self._bodies = self._find_bodies()
            process.start()
            self._claim_vehicles()
            self._await_positions(startup_timeout)
        except BaseException:
            self._release()
            self._end()
            raise

    def vehicle(self, name: str) -> RosVehicle:
        """Return a vehicle."""
        self.observer.check()
        self._check_names([name])
        vehicle = self._vehicles[name]
        assert isinstance(vehicle, RosVehicle)
        return vehicle

    @override
    def adopt(self, name: str) -> None:
        """Register a vehicle that flies by other commands: it is landed at the end."""
        self.observer.check()
        is_new = name not in self.flying
        super().adopt(name)
        if is_new:
            self._handle.submit(self._publish_claim)

    def dry_run(self, mission: Callable[[VehicleGroup], Any]) -> float:
        """Check ``mission(fleet)`` by a dry run; return its duration, s.

        `MissionError`: the mission would fail.
        """
        return dry_run(self, mission)

    @override
    def warn(self, text: str) -> None:
        super().warn(text)
        self._handle.warn(text)

    def fly(self, mission: Callable[[VehicleGroup], Any]) -> None:
        """Check ``mission(fleet)`` by a dry run, then fly it."""
        duration = self.dry_run(mission)
        self.observer.passed(self.names, duration)
        self._handle.info(f"{', '.join(self.names)}: dry run passed, a mission of {duration:.0f} s")
        mission(self)

    @override
    def __exit__(self, kind: type[BaseException] | None, error: Any, traceback: Any) -> None:
        """Land the vehicles that still fly, also after an error; log those that cannot land."""
        self.ending.run(lambda: self.land_at_end(kind, error))

    def _end_early(self, why):
        self.ending.run(lambda: self.land_at_end(MissionError, MissionError(why)))

    def land_at_end(self, kind: type[BaseException] | None, error: Any) -> None:
        """Land the vehicles that still fly as `__exit__` does, in a call by `ending`."""
        try:
            if self.flying:
                why = f" after {error!r}" if error is not None else ""
                self._handle.warn(f"landing {', '.join(self.flying)}{why}")
            super().__exit__(kind, error, None)
        finally:
            if self.flying:
                self._handle.error(f"MAY STILL FLY: {', '.join(self.flying)}")
            else:
                self._release()
            self._end()

    @override
    def _commanding(self):
        return self.ending.commanding()

    @override
    def _start(self, names):
        vehicles = [self.vehicle(name) for name in names]
        is_streamed = any(vehicle.is_streamed for vehicle in vehicles)
        # All vehicles of a driver; fewer are called one by one.
        if self._driver and len(vehicles) == len(self._all_vehicles) and not is_streamed:
            return dict.fromkeys(names, self._driver.start_trajectory(Playback(0)))
        if tops := [vehicle.top for vehicle in vehicles if not vehicle.uses_driver]:
            self._handle.submit(self._starts.publish, String(" ".join(tops)))
        return {v.name: v.start() if v.uses_driver else done(None) for v in vehicles}

    # Other missions.

    def _claim_vehicles(self):
        """Claim the vehicles, unless another mission has them."""
        if self.observer.dry_runs_only:
            return
        end = time.monotonic() + _MISSIONS_LIMIT
        nodes = mission_nodes(self._handle)
        while len(self._missions.heard) < nodes and time.monotonic() < end:
            time.sleep(0.01)
        self._refuse_claimed()
        self._claim = self._handle.publisher(MISSION_TOPIC, String, latch=True)
        self._publish_claim()
        self._heartbeat = self._handle.timer(MISSION_PERIOD, self._publish_claim, steady=True)

    def _refuse_claimed(self):
        for mission, claim in [*self._missions.claims.items()]:
            if taken := [name for name in self.names if name in claim.vehicles]:
                for name in taken:
                    # The other mission lands them.
                    self.release(name)
                raise MissionError(
                    f"{', '.join(taken)}: in use by the running mission {mission}; wait for its "
                    "end, or choose other vehicles"
                )

    @override
    def _check_apart(self, changed, may_be_late=False):
        # The other mission may have begun at the same moment, or while this one was stopped.
        self._refuse_claimed()
        super()._check_apart(changed, may_be_late)

    def _publish_claim(self):
        # A fleet process lands those that fly when these messages end.
        self._claim.publish(Claim(self.flying, self.names).message(self._mission))

    def _release(self):
        if self._heartbeat is not None:
            self._heartbeat.stop()
            self._heartbeat = None
            self._claim.publish(String(self._mission))

    def _find_bodies(self):
        """Return the lookups of the bodies that nobody flies and vehicles keep apart from."""
        lookups = {}
        fixed = self._handle.get_param("/fleet/frames/fixed", FRAME, "world")
        for name, body in self._handle.get_param(OBSTACLES, NODE_PARAMETERS, {}).items():
            lookups[name] = partial(self._handle.listen_to_poses(), fixed, body["frame"])
            self._buffers[name] = float(body["buffer"])
        return lookups

    def _find_obstacles(self):
        bodies = {}
        for name, lookup in self._bodies.items():
            # It has not been seen yet; the fleet warns.
            with contextlib.suppress(TransformError):
                bodies[name] = Obstacle(lookup().position, False)
        return bodies | {
            name: Obstacle(self._place_of_other(name), name in claim.flying)
            for claim in [*self._missions.claims.values()]
            for name in claim.vehicles
            if name not in self._all_vehicles
        }

    def _place_of_other(self, name):
        if name not in self._others:
            access = _access(self._handle, name, flown_vehicles(self._handle.service_nodes()))
            self._others[name] = RosVehicleState(name, self._handle, access, self._max_age)
            if buffer := _buffer(self._handle, name):
                self._buffers[name] = buffer
        vehicle = self._others[name]
        end = time.monotonic() + _OBSTACLE_LIMIT
        self.clock.wait_until(
            lambda: vehicle.position() is not None or time.monotonic() > end, math.inf
        )
        return vehicle.position()

    def _await_positions(self, timeout):
        end = time.monotonic() + timeout
        while missing := [name for name in self.names if self._vehicles[name].position() is None]:
            if time.monotonic() > end:
                raise MissionError(
                    f"{', '.join(missing)}: no position for {timeout:g} s; "
                    "expected a state, or for the driver's vehicles a pose or a tf frame"
                )
            time.sleep(0.01)


def vehicles_of(names: str | Path | Sequence[str]) -> tuple[list[str], dict[str, float]]:
    """Return the names of vehicles, and the collision buffers (m) of those in a fleet file.

    `MissionError`: the list is empty, or has a name twice.
    """
    if isinstance(names, Path) or (isinstance(names, str) and names.endswith((".yaml", ".yml"))):
        try:
            vehicles = fleet_file.load(names).vehicles
            return [v.name for v in vehicles], {v.name: v.buffer for v in vehicles}
        except ParameterError as error:
            raise MissionError(str(error)) from None
    chosen = [names] if isinstance(names, str) else list(names)
    if not chosen or any(not isinstance(name, str) or not name for name in chosen):
        raise MissionError(f"the vehicles are {names!r}; expected names, such as ['cf1', 'cf2']")
    for name in chosen:
        if chosen.count(name) > 1:
            raise MissionError(f"the vehicle {name!r} is named twice; expected different names")
    return chosen, {}


def _buffer(handle, name):
    return handle.get_param(f"{prefix(name)}/{BUFFER}", Number("m", above=0.0), None)


def _connect(process, handle, max_age, names, timeout):
    """Return the vehicles, and the namespace of services for all of them, if there is one."""
    end = time.monotonic() + timeout
    found: dict[str, RosVehicle] = {}
    while True:
        services = handle.service_nodes()
        drivers = flown_vehicles(services)
        for name in names:
            top = prefix(name)
            if name in found or not (
                name in drivers or {f"{top}/takeoff", f"{top}/land"} <= services.keys()
            ):
                continue
            access = _access(handle, name, drivers)
            if name not in drivers:
                handle.set_param(f"{access.top}/reference/yaw", access.has_yaw)
                if not HighLevelNode().initialize(process.handle(access.top)):
                    raise MissionError(
                        f"{access.top} could not be started; its reason is in the log"
                    )
            found[name] = RosVehicle(name, handle, access, max_age)
        missing = [prefix(name) for name in names if name not in found]
        if not missing:
            return [found[name] for name in names], common_services(services, names)
        if time.monotonic() > end:
            there = sorted(
                {s.rpartition("/takeoff")[0].strip("/") or "/" for s in services if "takeoff" in s}
            )
            raise MissionError(
                f"no takeoff and land, and no go_to, below {', '.join(missing)} after {timeout:g} "
                f"s; takeoff is offered by: {', '.join(there) or 'no node'}"
            )
        time.sleep(_POLL)


def _access(handle, name, drivers):
    """Return the `Access` to a vehicle; ``drivers`` are as from `flown_vehicles`."""
    top = prefix(name)
    commander = f"{top}/{HIGH_LEVEL}"
    if name not in drivers:
        # This process has its `HighLevelNode`.
        has_yaw = topic_types(handle).get(f"{top}/ref") == _YAW_STATE
        return Access(commander, False, None, has_yaw)
    if driver := drivers[name]:
        fixed = handle.get_param(f"{driver}/frames/fixed", FRAME, "world")
        return Access(top, True, (fixed, name), True)
    # In a fleet, one message on /tf has the poses of all vehicles.
    fixed, own = (
        handle.get_param(f"{commander}/frames/{frame}", FRAME, None) for frame in ("fixed", "robot")
    )
    has_yaw = handle.get_param(f"{commander}/reference/yaw", BOOLEAN, False)
    return Access(commander, False, None if None in (fixed, own) else (fixed, own), has_yaw)


def topic_types(handle: NodeHandle) -> dict[str, str]:
    """Return the types of all topics that are registered with the master."""
    return dict(rosgraph.Master(handle.name).getTopicTypes())


def mission_nodes(handle: NodeHandle) -> int:
    """Return the number of mission nodes, including killed ones."""
    publishers, _, _ = rosgraph.Master(handle.name).getSystemState()
    return sum(len(nodes) for topic, nodes in publishers if topic == MISSION_TOPIC)


def _program():
    return re.sub(r"\W", "_", Path(sys.argv[0]).stem) or "mission"


def catch_signals(land: Callable[[], None]) -> None:
    """Make SIGINT, SIGTERM and SIGHUP raise, so that a script lands its vehicles at the end.

    The script may handle the first one, and fly on. At each later one a thread calls ``land()``:
    whatever the main thread was interrupted in may hold locks. A script that nohup has started
    continues without its terminal.
    """
    # Also where the script is a node of rospy's.
    if threading.current_thread() is not threading.main_thread():
        return
    caught = []

    def interrupt(number, _):
        caught.append(number)
        if len(caught) > 1:
            threading.Thread(target=land).start()
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        sys.exit(128 + number)

    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if each != signal.SIGHUP or signal.getsignal(each) is not signal.SIG_IGN:
            signal.signal(each, interrupt)
