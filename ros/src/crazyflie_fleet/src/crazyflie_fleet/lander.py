"""Lands vehicles of a fleet in rounds, by the services of each."""

from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from functools import partial

import genpy
import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import String
from std_srvs.srv import Empty, EmptyRequest

from crazyflie_driver.srv import GoTo, GoToRequest
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.landing import SIDE_SPEED, next_round
from crazyflie_fleet.separation import RELEASE_RATIO
from crazyflie_fleet.straight_move import shortest_duration
from crazyflie_fleet.vehicle_states import VehicleStates
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import NodeHandle

SERVICE_TIMEOUT = 60.0  #: Of a takeoff or landing, s of the machine's clock.
LANDING_TOPIC = "/fleet/landing"  #: Names of vehicles that only the fleet moves, until they land.
_PERIOD = 0.1  #: Between two updates of a landing, s.
#: A round begins when all vehicles are slower than this, m/s, or after this time, s.
_SLOW, _BRAKING_TIMEOUT = 0.3, 3.0

#: A vehicle lands within this distance of its free place, m; within the second one if it takes
#: longer than the timeout beyond the planned duration, s.
_ARRIVED, _NEAR, _ARRIVAL_TIMEOUT = 0.05, 0.1, 5.0

_SHORTEST_MOVE = 2.0  #: s.

_UP = (FlightStatus.FLYING, FlightStatus.TAKING_OFF)

Refusals = Mapping[str, str]


class Lander:
    """The landings of a fleet, see `landing`; ``states`` are those of all its vehicles."""

    def __init__(self, handle: NodeHandle, fleet: FleetConfig, states: VehicleStates):
        self._handle = handle
        self._states = states
        self._numbers = {name: number for number, name in enumerate(states.names)}
        radii = np.array([fleet[name].buffer for name in states.names])
        # At a smaller distance the collision avoidance would not release a vehicle.
        self._limits = RELEASE_RATIO * (radii[:, None] + radii)
        self._publisher = handle.publisher(LANDING_TOPIC, String, latch=True)
        # Vehicles in the air that have still to land, and the free places that some fly to.
        self._left: list[str] = []
        self._goals: dict[str, tuple[float, float, float]] = {}
        self._deadline = 0.0
        self._begin = 0.0
        self._calls: set[str] = set()
        self._refusals: dict[str, str] = {}
        self._answers: list[Future[Refusals]] = []
        handle.timer(_PERIOD, self._on_timer)

    def land(self, names: Iterable[str]) -> "Future[Refusals]":
        """Land vehicles; return, when all are down, name to reason of those that did not land."""
        answer: Future[Refusals] = Future()
        self._answers.append(answer)
        self._begin = self._handle.time()
        for name in names:
            position = self._states.positions[self._numbers[name]]
            if self._is_up(name) and np.isfinite(position).all():
                self._left += [name] * (name not in self._left)
            elif name not in self._calls:
                # Its takeoff server decides.
                self._call_land(name)
        self._publish_left()
        return answer

    def abort(self) -> None:
        """End all landings; vehicles that have not begun to land stay in the air."""
        waiting = {*self._left, *self._calls}
        self._refusals |= dict.fromkeys(waiting, "the landing of the fleet has failed; see the log")
        self._left, self._goals = [], {}
        self._calls.clear()
        self._finish()

    def _is_up(self, name):
        return self._states.flight_states[self._numbers[name]] in _UP

    def _call_land(self, name):
        self._calls.add(name)
        self._call(name, "land", Empty, EmptyRequest(), self._on_landed)

    def _call(self, name, service, service_type, request, on_answer):
        service = f"/{name}/{service}"
        call = self._handle.call_service(service, service_type, request, SERVICE_TIMEOUT)
        call.add_done_callback(partial(on_answer, name))

    def _on_landed(self, name, done):
        self._calls.discard(name)
        self._note_refusal(name, done)

    def _note_refusal(self, name, done):
        if done.exception() is not None:
            self._refusals[name] = str(done.exception())
            self._goals.pop(name, None)
            self._left = [each for each in self._left if each != name]

    def _on_timer(self):
        if not self._answers:
            return
        # Another node may have landed it, or stopped its motors.
        self._left = [name for name in self._left if self._is_up(name)]
        self._goals = {name: goal for name, goal in self._goals.items() if name in self._left}
        if self._goals:
            self._land_arrived()
        elif not self._calls and not self._left:
            self._finish()
        elif not self._calls and self._are_slow():
            self._begin_round()

    def _are_slow(self):
        numbers = [self._numbers[name] for name in self._left]
        speeds = np.linalg.norm(self._states.velocities[numbers], axis=1)
        is_late = not 0.0 <= self._handle.time() - self._begin < _BRAKING_TIMEOUT
        return is_late or bool((speeds < _SLOW).all())

    def _begin_round(self):
        positions = self._states.positions
        known = np.flatnonzero(np.isfinite(positions).all(axis=1))
        names = [self._states.names[number] for number in known]
        # A vehicle that descends counts as on the ground.
        is_down = np.array([not self._is_up(name) for name in names])
        lands = np.array([name in self._left for name in names])
        everywhere = np.full((len(names), 2), np.inf)
        limits = self._limits[np.ix_(known, known)]
        chosen = next_round(positions[known], lands, is_down, limits, -everywhere, everywhere)
        goals = {names[k]: (*place, float(positions[known[k], 2])) for k, place in chosen.items()}
        farthest = max(self._distance(name, goal) for name, goal in goals.items())
        if farthest > 0.0:
            self._go_aside(goals, farthest)
            return
        for name in goals:
            self._call_land(name)
        self._left = [name for name in self._left if name not in goals]

    def _distance(self, name, goal):
        return float(np.linalg.norm(self._states.positions[self._numbers[name]] - goal))

    def _go_aside(self, goals, distance):
        duration = max(_SHORTEST_MOVE, distance / SIDE_SPEED, 1.1 * shortest_duration(distance))
        self._goals = goals
        self._deadline = self._handle.time() + duration + _ARRIVAL_TIMEOUT
        for name, goal in goals.items():
            request = GoToRequest(0, False, Point(*goal), 0.0, genpy.Duration.from_sec(duration))
            self._call(name, "go_to", GoTo, request, self._note_refusal)

    def _land_arrived(self):
        away = {name: self._distance(name, goal) for name, goal in self._goals.items()}
        if max(away.values()) > _ARRIVED and self._handle.time() <= self._deadline:
            return
        for name, (x, y, _) in self._goals.items():
            self._left.remove(name)
            if away[name] <= _NEAR:
                self._call_land(name)
            else:
                self._refusals[name] = (
                    f"stays in the air: it is {away[name]:.2f} m from the free place to land at "
                    f"({x:.2f}, {y:.2f})"
                )
        self._goals = {}

    def _finish(self):
        self._publish_left()
        answers, self._answers = self._answers, []
        refusals, self._refusals = self._refusals, {}
        for answer in answers:
            answer.set_result(refusals)

    def _publish_left(self):
        self._publisher.publish(String(" ".join(self._left)))
