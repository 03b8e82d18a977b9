"""Requests of pages and their answers, as plain data and in words."""

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field
from typing import Any

from crazyflie_dashboard.snapshot import Action, Triple
from crazyflie_utils.refusal import by_reason, listed
from crazyflie_utils.steps import Steps

#: Largest age of a command (s): an older one was delayed in a browser or a network, and is not
#: carried out.
MAX_COMMAND_AGE = 1.0

Outcomes = Mapping[str, str]  #: Vehicle to the refusal of a command, or "".


@dataclass(frozen=True)
class Command:
    """A command of an operator for vehicles."""

    action: Action
    vehicles: tuple[str, ...]  #: Names.
    clicked: float  #: Time of the click, by time.monotonic() of this computer (s).
    goal: Triple | None = None  #: Goal of a go-to command: x, y, z (m).
    yaw: float | None = None  #: Heading of a go-to command; None keeps it (rad).
    height: float = 1.0  #: Height of a takeoff (m).
    speed: float = 0.5  #: Speed of a go-to command (m/s).

    @property
    def words(self) -> str:
        """The command as a text for the log."""
        return self._text(", ".join(self.vehicles))

    @property
    def title(self) -> str:
        """The command as a text for the page, which has no room for many names."""
        return self._text(listed(self.vehicles))

    def _text(self, names):
        text = f"{self.action.value} {names}"
        if self.action == Action.TAKEOFF:
            text += f" to {self.height:g} m"
        if self.goal is not None:
            text += f" to ({', '.join(f'{x:.2f}' for x in self.goal)}) m"
        return text


@dataclass(frozen=True)
class ParameterInfo:
    """A parameter that can be changed."""

    owner: str  #: Node, or the vehicle of a firmware parameter.
    name: str  #: Name such as topics/state, or group.name of a firmware parameter.
    kind: str  #: "bool", "int", "float" or "str".
    value: bool | int | float | str
    unit: str = ""
    help: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()  #: Allowed values of a text; any if empty.
    is_firmware: bool = False


@dataclass(frozen=True)
class DryRunResult:
    """The result of a dry run: ``text`` is the reason if it has not passed, or a summary.

    ``paths`` are the commanded positions by vehicle, for the scene.
    """

    passed: bool
    text: str
    paths: Mapping[str, tuple[Triple, ...]] = field(default_factory=dict)
    duration: float | None = None  #: s.
    steps: tuple[tuple[float, str], ...] = ()  #: When each command begins (s), and its text.


@dataclass(frozen=True)
class Series:
    """Numbers over time of one plot: ``times`` in s before now are negative, oldest first."""

    name: str
    unit: str
    times: tuple[float, ...]
    values: tuple[float, ...]


def words(error: BaseException) -> str:
    """Return the text of an answer; `NodeHandle.call_service` has removed rospy's words."""
    return str(error) or repr(error)


def gathered(answers: "Mapping[str, Future[Any]]") -> Steps[Outcomes]:
    """Return the outcomes of all vehicles, when the last one has answered."""
    texts = dict.fromkeys(answers, "")
    for name, answer in answers.items():
        try:
            yield answer
        except Exception as error:
            texts[name] = words(error)
    return texts


def summary(outcomes: Outcomes) -> list[str]:
    """Return the refusals, each text once with its vehicles."""
    return by_reason({name: text for name, text in outcomes.items() if text}, listed)
