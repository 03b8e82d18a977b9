"""Lands a fleet in stages over ROS."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any

import genpy
import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import String
from std_srvs.srv import Empty, EmptyRequest
from typing_extensions import override

from crazyflie_driver.srv import GoTo, GoToRequest
from crazyflie_fleet.fleet_config import FleetConfig
from crazyflie_fleet.high_level_services import KEEP_HEADING
from crazyflie_fleet.landing_rounds import (
    SIDE_SPEED,
    LandingSide,
    Place,
    Scene,
    land_in_rounds,
)
from crazyflie_fleet.references_node import LANDING_TOPIC, VehicleStates
from crazyflie_fleet.separation import RELEASE_RATIO
from crazyflie_model.planner import shortest_duration
from crazyflie_msgs.msg import FlightStatus
from crazyflie_utils import NodeHandle

SERVICE_TIMEOUT = 60.0  #: Timeout of takeoffs and landings (s of the machine's clock).
_PERIOD = 0.1  #: Period of the updates of a landing (s).
#: Speed of all vehicles below which a round begins (m/s), and longest wait for it (s).
_SLOW, _BRAKING_TIMEOUT = 0.3, 3.0

_SHORTEST_MOVE = 2.0  #: Shortest duration of a move to a free place (s).

_UP = (FlightStatus.FLYING, FlightStatus.TAKING_OFF)

Refusals = Mapping[str, str]


class Lander(LandingSide):
    """The landings of a fleet, see `landing_rounds`; ``states`` are those of all its vehicles."""

    arrival_timeout = 5.0

    def __init__(self, handle: NodeHandle, fleet: FleetConfig, states: VehicleStates):
        self._handle = handle
        self._states = states
        radii = np.array([fleet[name].buffer for name in states.names])
        # At a smaller distance the collision avoidance would not release a vehicle.
        self._limits = RELEASE_RATIO * (radii[:, None] + radii)
        self._publisher = handle.publisher(LANDING_TOPIC, String, latch=True)
        self._left: list[str] = []
        self._begin = 0.0
        # Vehicles whose landing service has not answered.
        self._calls: set[str] = set()
        self._refusals: dict[str, str] = {}
        self._stood: list[str] = []  # Vehicles that were to land and stood on the ground already.
        self._answer: Future[Refusals] | None = None  # Of all landings that have not ended.
        self._rounds: Iterator[None] = iter(())
        handle.timer(_PERIOD, self._on_timer)

    def land(self, names: Iterable[str]) -> "Future[Refusals]":
        """Land vehicles; return, when all are down, name to reason of those that did not land."""
        answer = self._answer
        if answer is None:
            answer = self._answer = Future()
            self._rounds = land_in_rounds(self)
        self._begin = self.time()
        for name in names:
            position = self._states.positions[self._states.numbers[name]]
            if self._is_up(name) and np.isfinite(position).all():
                self._left += [name] * (name not in self._left)
            elif name not in self._calls:
                # Its takeoff server lands it.
                self._call_land(name)
        self._publish_left()
        return answer

    def abort(self) -> None:
        """End all landings; vehicles that have not begun to land stay in the air."""
        waiting = {*self._left, *self._calls}
        self._refusals |= dict.fromkeys(waiting, "the landing of the fleet has failed; see the log")
        self._left = []
        self._calls.clear()
        self._finish()

    def _on_timer(self):
        if self._answer is not None and next(self._rounds, self) is self:
            self._finish()

    def _finish(self):
        self._publish_left()
        answer, self._answer = self._answer, None
        refusals, self._refusals = self._refusals, {}
        stood, self._stood = self._stood, []
        if stood:
            self._handle.info(f"on the ground already: {', '.join(stood)}")
        if answer is not None:
            answer.set_result(refusals)

    def _publish_left(self):
        self._publisher.publish(String(" ".join(self._left)))

    def _is_up(self, name):
        return self._states.flight_state(name) in _UP

    # Methods that `land_in_rounds` calls.

    @override
    def time(self) -> float:
        return self._handle.time()

    @override
    def left(self) -> list[str]:
        # Another node may have landed one, or stopped its motors.
        self._left = [name for name in self._left if self._is_up(name)]
        return self._left

    @override
    def is_busy(self) -> bool:
        numbers = [self._states.numbers[name] for name in self._left]
        speeds = np.linalg.norm(self._states.velocities[numbers], axis=1)
        is_late = not 0.0 <= self.time() - self._begin < _BRAKING_TIMEOUT
        return bool(self._calls) or not (is_late or bool((speeds < _SLOW).all()))

    @override
    def scene(self) -> tuple[Sequence[str], Scene]:
        positions = self._states.positions
        known = np.flatnonzero(np.isfinite(positions).all(axis=1))
        names = [self._states.names[number] for number in known]
        lands = np.array([name in self._left for name in names])
        # A vehicle that descends is treated as one on the ground.
        is_down = np.array([not self._is_up(name) for name in names])
        limits = self._limits[np.ix_(known, known)]
        return names, Scene(positions[known], lands, is_down, limits)

    @override
    def distance(self, name: str, goal: Place) -> float:
        return float(np.linalg.norm(self._states.positions[self._states.numbers[name]] - goal))

    @override
    def go_aside(self, goals: Mapping[str, Place]) -> float:
        farthest = max(self.distance(name, goal) for name, goal in goals.items())
        duration = max(_SHORTEST_MOVE, farthest / SIDE_SPEED, 1.1 * shortest_duration(farthest))
        for name, goal in goals.items():
            request = GoToRequest(
                0, False, Point(*goal), KEEP_HEADING, genpy.Duration.from_sec(duration)
            )
            call = self.call(name, "go_to", GoTo, request)
            call.add_done_callback(partial(self._note_refusal, name))
        return self.time() + duration

    @override
    def descend(self, names: Sequence[str]) -> None:
        for name in names:
            self._left.remove(name)
            self._call_land(name)

    @override
    def refuse(self, name: str, reason: str) -> None:
        self._refusals[name] = reason
        self._left = [each for each in self._left if each != name]

    def call(self, name: str, service: str, service_type: Any, request: Any) -> "Future[Any]":
        """Call a service of a vehicle."""
        service = f"/{name}/{service}"
        return self._handle.call_service(service, service_type, request, SERVICE_TIMEOUT)

    def _call_land(self, name):
        self._calls.add(name)
        call = self.call(name, "land", Empty, EmptyRequest())
        call.add_done_callback(partial(self._on_landed, name))

    def _on_landed(self, name, done):
        self._calls.discard(name)
        is_down = self._states.flight_state(name) == FlightStatus.ON_GROUND
        if is_down and done.exception() is not None:
            self._stood.append(name)
        else:
            self._note_refusal(name, done)

    def _note_refusal(self, name, done):
        if done.exception() is not None:
            self.refuse(name, str(done.exception()))
