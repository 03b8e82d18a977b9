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
from crazyflie_fleet.fleet import Fleet
from crazyflie_fleet.landing import SIDE_SPEED, next_round
from crazyflie_fleet.separation import RELEASE
from crazyflie_fleet.sightings import FLYING, Sightings
from crazyflie_fleet.way import shortest
from crazyflie_utils import NodeHandle

LIMIT = 60.0
"""How long a vehicle may take to take off or to land, s of the machine's clock."""

LANDING_TOPIC = "/fleet/landing"
"""Names of vehicles that are led by the fleet alone, until they land."""

_PERIOD = 0.1
"""From one look at a landing to the next, s."""

_SETTLED, _SETTLE_LIMIT = 0.3, 3.0
"""Vehicles that were on their way are slow, m/s, before a round begins; or have had so long, s."""

_ARRIVED, _LATE, _ARRIVAL_LIMIT = 0.05, 0.1, 5.0
"""So near a vehicle has reached its free place, m; so near it may land there when it has taken so
long beyond what was planned, m and s."""

_SHORTEST_WAY = 2.0
"""s."""

_UP = (FLYING, "taking_off")

Refusals = Mapping[str, str]


class Lander:
    """The landings of a fleet, as `crazyflie_fleet.landing` has them.

    Parameters
    ----------
    handle : NodeHandle
    fleet : Fleet
    sightings : Sightings
        Of all its vehicles.
    """

    def __init__(self, handle: NodeHandle, fleet: Fleet, sightings: Sightings):
        self._handle = handle
        self._sightings = sightings
        self._numbers = {name: number for number, name in enumerate(sightings.names)}
        radii = np.array([fleet[name].buffer for name in sightings.names])
        # With less the watch of the distances would not let a vehicle go again.
        self._limits = RELEASE * (radii[:, None] + radii)
        self._publisher = handle.publisher(LANDING_TOPIC, String, latch=True)
        # Those in the air that have not been told to land; where some of them are on their way to.
        self._left: list[str] = []
        self._goals: dict[str, tuple[float, float, float]] = {}
        self._deadline = 0.0
        self._begun_at = 0.0
        self._calls: set[str] = set()
        self._refusals: dict[str, str] = {}
        self._answers: list[Future[Refusals]] = []
        handle.timer(_PERIOD, self._on_timer)

    def land(self, names: Iterable[str]) -> "Future[Refusals]":
        """Land vehicles; return why some have not: name to reason, when all others are down."""
        answer: Future[Refusals] = Future()
        self._answers.append(answer)
        self._begun_at = self._handle.time()
        for name in names:
            if self._is_up(name) and self._is_seen(name):
                self._left += [name] * (name not in self._left)
            elif name not in self._calls:
                # Its server knows better what there is to do.
                self._call_land(name)
        self._tell()
        return answer

    def give_up(self) -> None:
        """End all landings that are under way; vehicles that were not told to land stay."""
        waiting = {*self._left, *self._calls}
        self._refusals |= dict.fromkeys(waiting, "the landing of the fleet has failed; see the log")
        self._left, self._goals = [], {}
        self._calls.clear()
        self._finish()

    def _is_up(self, name):
        return self._sightings.flight_states[self._numbers[name]] in _UP

    def _is_seen(self, name):
        return bool(np.isfinite(self._sightings.positions[self._numbers[name]]).all())

    def _call_land(self, name):
        self._calls.add(name)
        self._call(name, "land", Empty, EmptyRequest(), self._on_landed)

    def _call(self, name, service, service_type, request, on_answer):
        call = self._handle.call_service(f"/{name}/{service}", service_type, request, LIMIT)
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
        # Somebody else may have landed it, or stopped its motors.
        self._left = [name for name in self._left if self._is_up(name)]
        self._goals = {name: goal for name, goal in self._goals.items() if name in self._left}
        if self._goals:
            self._go_on_sideways()
        elif not self._calls and not self._left:
            self._finish()
        elif not self._calls and self._are_settled():
            self._begin_round()

    def _are_settled(self):
        speeds = np.linalg.norm(self._sightings.velocities[self._numbers_of(self._left)], axis=1)
        has_waited = not 0.0 <= self._handle.time() - self._begun_at < _SETTLE_LIMIT
        return has_waited or bool((speeds < _SETTLED).all())

    def _numbers_of(self, names):
        return [self._numbers[name] for name in names]

    def _begin_round(self):
        positions = self._sightings.positions
        known = np.flatnonzero(np.isfinite(positions).all(axis=1))
        names = [self._sightings.names[number] for number in known]
        # Who is coming down already is as good as on the ground.
        stands = np.array([not self._is_up(name) for name in names])
        lands = np.array([name in self._left for name in names])
        everywhere = np.full((len(names), 2), np.inf)
        limits = self._limits[np.ix_(known, known)]
        chosen = next_round(positions[known], lands, stands, limits, -everywhere, everywhere)
        goals = {names[k]: (*place, float(positions[known[k], 2])) for k, place in chosen.items()}
        distances = {name: self._distance(name, goal) for name, goal in goals.items()}
        if max(distances.values()) > 0.0:
            self._go_sideways(goals, max(distances.values()))
            return
        for name in goals:
            self._call_land(name)
        self._left = [name for name in self._left if name not in goals]

    def _distance(self, name, goal):
        return float(np.linalg.norm(self._sightings.positions[self._numbers[name]] - goal))

    def _go_sideways(self, goals, distance):
        duration = max(_SHORTEST_WAY, distance / SIDE_SPEED, 1.1 * shortest(distance))
        self._goals = goals
        self._deadline = self._handle.time() + duration + _ARRIVAL_LIMIT
        for name, goal in goals.items():
            request = GoToRequest(0, False, Point(*goal), 0.0, genpy.Duration.from_sec(duration))
            self._call(name, "go_to", GoTo, request, self._note_refusal)

    def _go_on_sideways(self):
        away = {name: self._distance(name, goal) for name, goal in self._goals.items()}
        is_late = self._handle.time() > self._deadline
        if max(away.values()) > _ARRIVED and not is_late:
            return
        for name, (x, y, _) in self._goals.items():
            self._left.remove(name)
            if away[name] <= _LATE:
                self._call_land(name)
            else:
                self._refusals[name] = (
                    f"stays in the air: it is {away[name]:.2f} m from the free place to land at "
                    f"({x:.2f}, {y:.2f})"
                )
        self._goals = {}

    def _finish(self):
        self._tell()
        answers, self._answers = self._answers, []
        refusals, self._refusals = self._refusals, {}
        for answer in answers:
            answer.set_result(refusals)

    def _tell(self):
        self._publisher.publish(String(" ".join(self._left)))
