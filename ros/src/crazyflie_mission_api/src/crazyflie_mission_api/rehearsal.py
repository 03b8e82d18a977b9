"""A mission without vehicles: everything is checked as in flight, and takes no time."""

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from crazyflie_mission_api.course import Course
from crazyflie_mission_api.limits import EVERYWHERE, Bounds, MissionError
from crazyflie_mission_api.roster import Rules
from crazyflie_mission_api.team import Team
from crazyflie_mission_api.trajectories import Pieces, straight
from crazyflie_model.angles import Triple

_STEP = 0.05
"""Of time, s."""


class RehearsalClock:
    """Time that passes when somebody waits."""

    def __init__(self) -> None:
        self._time = 0.0

    def time(self) -> float:
        """Return the time, s."""
        return self._time

    def wait_until(self, condition: Callable[[], bool], deadline: float) -> bool:
        """Let time pass until ``condition()`` or ``deadline`` (s); return the condition."""
        while not (done := condition()) and self._time < deadline:
            self._time = min(self._time + _STEP, deadline)
        return done


class RehearsedVehicle:
    """A vehicle that is always where it was told to be.

    Parameters
    ----------
    name : str
    clock : Clock
    position : tuple, 3 components
        Where it stands, m.
    bounds : Bounds
    heading : float
        rad.
    start_skew : float
        Of the vehicle whose flight is rehearsed, s.
    """

    def __init__(
        self,
        name: str,
        clock: RehearsalClock,
        position: Triple,
        bounds: Bounds = EVERYWHERE,
        heading: float = 0.0,
        start_skew: float = 0.0,
    ):
        self.name = name
        self.bounds = bounds
        self.start_skew = start_skew
        self._clock = clock
        self._course = Course.rest(position, heading)
        self._prepared: Pieces = ()
        self._flies = False

    def position(self) -> Triple:
        """Return where it is, m."""
        return self._course.goal(self._clock.time()).position

    def heading(self) -> float:
        """Return its heading, rad."""
        return self._course.goal(self._clock.time()).yaw

    def trouble(self) -> str:
        """Return an empty text."""
        return ""

    def has_landed(self) -> bool:
        """Return whether it stands."""
        return not self._flies and self._clock.time() >= self._course.end

    def take_off(self, height: float, duration: float) -> "Future[Any]":
        """Climb straight up."""
        self._flies = True
        x, y, _ = self.position()
        return self.go_to((x, y, height), self.heading(), duration)

    def land(self, duration: float) -> "Future[Any]":
        """Sink straight down."""
        x, y, _ = self.position()
        self._flies = False
        return self.go_to((x, y, 0.0), self.heading(), duration)

    def rest(self) -> None:
        """Do nothing."""

    def go_to(self, goal: Triple, yaw: float, duration: float) -> "Future[Any]":
        """Fly to a point."""
        start = self._course.goal(self._clock.time())
        return self._fly(straight(start.position, goal, start.yaw, yaw, duration))

    def prepare(self, pieces: Pieces, stream: bool) -> "Future[Any]":
        """Take a trajectory."""
        self._prepared = pieces
        return _done()

    def start(self) -> "Future[Any]":
        """Fly it."""
        return self._fly(self._prepared)

    def emergency(self) -> "Future[Any]":
        """Fall."""
        x, y, _ = self.position()
        self._flies = False
        self._course = Course.rest((x, y, 0.0))
        return _done()

    def _fly(self, pieces):
        self._course = Course(pieces, self._clock.time())
        return _done()


def _done():
    future: Future[Any] = Future()
    future.set_result(None)
    return future


class Rehearsal(Team):
    """A team whose vehicles only do as if.

    Parameters
    ----------
    starts : mapping of str to x, y, z
        Where each vehicle stands, m.
    rules : Rules, optional
    bounds : mapping of str to Bounds, optional
        The fences that vehicles have of their own.
    headings : mapping of str to float, optional
        rad; 0 by default.
    start_skews : mapping of str to float, optional
        s; 0 by default: vehicles begin together.
    """

    def __init__(
        self,
        starts: Mapping[str, Triple],
        rules: Rules | None = None,
        bounds: Mapping[str, Bounds] | None = None,
        headings: Mapping[str, float] | None = None,
        start_skews: Mapping[str, float] | None = None,
    ):
        clock = RehearsalClock()
        fences, yaws, skews = bounds or {}, headings or {}, start_skews or {}
        vehicles = [
            RehearsedVehicle(
                name,
                clock,
                position,
                fences.get(name, EVERYWHERE),
                yaws.get(name, 0.0),
                skews.get(name, 0.0),
            )
            for name, position in starts.items()
        ]
        super().__init__(vehicles, clock, rules)


def rehearse(team: Team, mission: Callable[[Team], Any]) -> float:
    """Fly ``mission(team)`` with vehicles that only do as if; return how long it takes, s.

    Parameters
    ----------
    team : Team
        On the ground.
    mission : callable
        It must decide nothing by what cannot be known before.

    Raises
    ------
    MissionError
        What the mission would have run into.
    """
    if team.flying:
        raise MissionError(f"{', '.join(team.flying)}: in flight; expected to be on the ground")
    starts = {name: team.position(name) for name in team.names}
    headings = {name: vehicle.heading() for name, vehicle in team._vehicles.items()}
    skews = {name: vehicle.start_skew for name, vehicle in team._vehicles.items()}
    fences = {name: team.fence(name) for name in team.names}
    rehearsal = Rehearsal(starts, team.rules, fences, headings, skews)
    with rehearsal:
        mission(rehearsal)
    return rehearsal.time()
