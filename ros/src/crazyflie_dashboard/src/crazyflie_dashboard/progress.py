"""What becomes of commands: sent, under way, and done, refused or ended by whom."""

import itertools
import math
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from enum import Enum

from crazyflie_dashboard.moves import formation
from crazyflie_dashboard.page_data import Command, Outcomes, summary, words
from crazyflie_dashboard.snapshot import Action, Triple, VehicleSnapshot

REACHED = 0.15  #: Distance from its goal at which a vehicle has arrived (m).
_LATE = 30.0  #: Time after its planned end at which a command is given up (s).
_MIN_SPEED = 0.1  #: Of the planned end of a command (m/s).
_KEPT = 200  #: Number of commands that are kept.
_LANDING = ("descending", "landing")  #: States in which a vehicle goes nowhere else.


class Stage(Enum):
    """How far a command is; the value is its word on the page."""

    SENT = "sent"
    UNDER_WAY = "under way"
    DONE = "done"
    REFUSED = "refused"
    ENDED = "ended"


OPEN = (Stage.SENT, Stage.UNDER_WAY)


@dataclass(frozen=True)
class Progress:
    """A command, or a mission, and what has become of it."""

    number: int
    text: str  #: The command in words.
    page: int  #: The page that has sent it.
    vehicles: tuple[str, ...]
    begun: float  #: s, by time.monotonic(); `changed` is the time of its stage.
    changed: float
    stage: Stage = Stage.SENT
    #: Count of the vehicles that have accepted, and how far it is or why it has ended.
    detail: str = ""
    reasons: tuple[str, ...] = ()  #: Refusals, each once, after its vehicles.
    #: What is left, by vehicle, for the cards.
    left: Mapping[str, str] = field(default_factory=dict)
    command: Command | None = None  #: None for a mission.

    @property
    def is_open(self) -> bool:
        """Whether it can still change."""
        return self.stage in OPEN

    @property
    def word(self) -> str:
        """The word of its stage: services that answer at the end have accepted it before."""
        is_begun = self.stage is Stage.SENT and bool(self.detail)
        return (Stage.UNDER_WAY if is_begun else self.stage).value

    @property
    def outcome(self) -> str:
        """What has become of it, in words."""
        details = [each for each in (self.detail, *self.reasons) if each]
        return f"{self.word}{', ' * bool(details)}{'; '.join(details)}"


@dataclass
class _Known:
    """What `Commands` knows of an open command."""

    goals: Mapping[str, Triple]  # m.
    end: float  # When it is to be done (s).
    has_flown: set[str] = field(default_factory=set)


class Commands:
    """The last commands of all pages.

    `update` and the callbacks of futures are called in the node's turn, `begin` in any thread.
    ``time()`` is in s; ``on_end`` is called with each command that can change no more.
    """

    def __init__(
        self, time: Callable[[], float], on_end: Callable[[Progress], None] = lambda row: None
    ):
        self._time, self._on_end = time, on_end
        self._rows: dict[int, Progress] = {}
        self._known: dict[int, _Known] = {}
        self._numbers = itertools.count(1)

    @property
    def rows(self) -> tuple[Progress, ...]:
        """The commands, oldest first."""
        return tuple(self._rows.values())

    def begin(
        self,
        page: int,
        text: str,
        names: tuple[str, ...],
        places: Mapping[str, Triple],
        command: Command | None = None,
    ) -> int:
        """Add a command for vehicles at places (m); return its number."""
        now, number, goals = self._time(), next(self._numbers), {}
        known = {name: places[name] for name in names if name in places}
        if command is not None and command.goal is not None and known:
            goals = formation(known, command.goal)
        elif command is not None and command.action is Action.TAKEOFF:
            goals = {name: (*place[:2], command.height) for name, place in known.items()}
        ways = [math.dist(known[name], goal) for name, goal in goals.items()]
        end = now + max(ways, default=0.0) / max(command.speed if command else 1.0, _MIN_SPEED)
        self._known[number] = _Known(goals, end)
        self._rows[number] = Progress(number, text, page, names, now, now, command=command)
        for old in list(self._rows)[:-_KEPT]:
            self._rows.pop(old)
            self._known.pop(old, None)
        return number

    def answered(self, number: int, done: "Future[Outcomes | None]") -> None:
        """Take the answer to a command: outcomes, or an error."""
        row = self._rows.get(number)
        if row is None or not row.is_open:
            return
        said = f"{row.command.action.value}: " if row.command else ""
        if error := done.exception():
            self._end(row, Stage.REFUSED, "", (words(error).removeprefix(said),))
            return
        outcomes = {n: text.removeprefix(said) for n, text in (done.result() or {}).items()}
        refused = {name: text for name, text in outcomes.items() if text}
        count = f"{len(row.vehicles) - len(refused)}/{len(row.vehicles)} accepted"
        if refused:
            self._end(row, Stage.REFUSED, count, tuple(summary(outcomes)))
        elif row.command is None or row.command.action not in _MOVES:
            self._end(row, Stage.DONE, count if len(row.vehicles) > 1 else "")
        else:
            self._set(row, stage=Stage.UNDER_WAY, detail=count)
        if len(refused) < len(row.vehicles):
            self._supersede(row)

    def ended(self, number: int, done: "Future[str]") -> None:
        """Note the end of a mission."""
        row = self._rows.get(number)
        if row is None:
            return
        error = done.exception()
        begun = row.stage is not Stage.SENT
        stage = Stage.DONE if not error else Stage.ENDED if begun else Stage.REFUSED
        took = f"after {self._time() - row.begun:.0f} s"
        self._end(row, stage, row.detail or took, (words(error),) if error else ())

    def follow(self, number: int) -> None:
        """Note that a mission flies: it is under way until its answer."""
        row = self._rows.get(number)
        if row is not None and row.is_open:
            self._set(row, stage=Stage.UNDER_WAY)
            self._supersede(row)

    def update(self, vehicles: Mapping[str, VehicleSnapshot]) -> tuple[Progress, ...]:
        """Compare open commands with where vehicles are; return all commands."""
        for row in self.rows:
            if row.is_open and row.command is not None and row.command.action in _MOVES:
                self._compare(row, row.command, vehicles)
        return self.rows

    def _compare(self, row, command, vehicles):
        known, action = self._known[row.number], command.action
        left, distances, reason = {}, [0.0], ""
        for name in row.vehicles:
            now = vehicles.get(name)
            if now is None:
                reason = reason or f"{name} has gone"
                continue
            if now.is_in_flight and now.state not in _LANDING:
                known.has_flown.add(name)
            distance = _distance(action, now, known.goals.get(name))
            if distance > 0.0:
                left[name] = f"{action.value}: {distance:.1f} m left"
                distances.append(distance)
            if not reason and name in known.has_flown:
                reason = _why_it_has_ended(action, now)
        is_answered = row.stage is Stage.UNDER_WAY
        accepted = len(row.vehicles) if is_answered else len(known.has_flown)
        if action is Action.LAND and not is_answered:
            accepted = sum(
                not each.is_in_flight or each.state in _LANDING
                for name in row.vehicles
                if (each := vehicles.get(name))
            )
        if reason:
            self._end(row, Stage.ENDED, reason)
        elif is_answered and not left:
            self._end(row, Stage.DONE, f"after {self._time() - row.begun:.0f} s")
        elif is_answered and self._time() > known.end + _LATE:
            self._end(row, Stage.ENDED, f"{max(distances):.1f} m are left after {_LATE:.0f} s more")
        elif accepted:
            text = f"{accepted}/{len(row.vehicles)} accepted"
            if left:
                time = max(distances) / command.speed
                text += f", {max(distances):.1f} m and {time:.0f} s left"
            self._set(row, detail=text, left=left)

    def _supersede(self, by):
        """End what other commands had begun with the same vehicles."""
        names = {*by.vehicles}
        for row in self.rows:
            is_other = row.number < by.number and row.stage is Stage.UNDER_WAY
            if is_other and names & {*row.vehicles}:
                self._end(row, Stage.ENDED, f"by: {by.text} (page {by.page})")

    def _end(self, row, stage, detail, reasons=()):
        self._known.pop(row.number, None)
        self._set(row, stage=stage, detail=detail, reasons=reasons, left={}, changed=self._time())
        self._on_end(self._rows[row.number])

    def _set(self, row, **changes):
        self._rows[row.number] = replace(row, **changes)


#: Commands that take time after they were accepted.
_MOVES = (Action.TAKEOFF, Action.LAND, Action.GO_TO)


def _distance(action: Action, now: VehicleSnapshot, goal: Triple | None) -> float:
    """Return the distance that is left (m); 0 when the vehicle has arrived."""
    if action is Action.LAND:
        height = 0.0 if now.position is None else now.position[2]
        return max(height, 0.01) if now.is_in_flight else 0.0
    if now.position is None or goal is None:
        return 0.0
    distance = math.dist(now.position, goal)
    if action is Action.TAKEOFF:
        # A takeoff server of another node has a height of its own.
        is_up = now.is_in_flight and now.state == "flying"
        distance = 0.0 if is_up else abs(goal[2] - now.position[2])
    return distance if distance > REACHED else 0.0


def _why_it_has_ended(action, now):
    if now.is_emergency:
        return f"by an emergency of {now.name}{': ' if now.reason else ''}{now.reason}"
    if action is Action.LAND or (now.is_in_flight and now.state not in _LANDING):
        return ""
    return f"{now.name} is {now.state}{': ' if now.reason else ''}{now.reason}"
