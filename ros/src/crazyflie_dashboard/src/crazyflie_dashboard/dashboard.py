"""What the page is written against: all that there is to see, and all that can be done.

Everything here may be called from any thread and does not wait. What takes time returns a future,
which fails with `RefusalError` (crazyflie_utils.refusal), whose text is for the operator; where a
service has refused, it is the service's own.
"""

from abc import ABC, abstractmethod
from concurrent.futures import Future
from dataclasses import dataclass

from crazyflie_dashboard.control import PageControl
from crazyflie_dashboard.snapshot import Action, Scene, Triple

#: An older command, s, is not carried out: it has waited in a browser or a network.
MAX_COMMAND_AGE = 1.0


@dataclass(frozen=True)
class Command:
    """What an operator has asked vehicles for."""

    action: Action
    vehicles: tuple[str, ...]  #: Names.
    clicked: float  #: When the operator did, by time.monotonic() of this computer.
    goal: Triple | None = None  #: Of go to: x, y, z in m.
    yaw: float | None = None  #: Of go to, rad; None keeps the heading.
    height: float = 1.0  #: Of a takeoff, m.
    speed: float = 0.5  #: Of go to, m/s.


@dataclass(frozen=True)
class Outcome:
    """What has become of a command: ``text`` is "" when the vehicle does it, else the refusal."""

    vehicle: str
    text: str = ""


@dataclass(frozen=True)
class ParameterInfo:
    """A parameter that can be changed."""

    owner: str  #: Node, or the vehicle of a firmware parameter.
    name: str  #: As in topics/state, or group.name of a firmware parameter.
    kind: str  #: "bool", "int", "float" or "str".
    value: bool | int | float | str
    unit: str = ""
    help: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()  #: Of a text; any if there are none.
    is_firmware: bool = False


@dataclass(frozen=True)
class MissionFile:
    """A script of missions, or a trajectory (CSV), that can be flown."""

    path: str
    title: str
    is_trajectory: bool


@dataclass(frozen=True)
class DryRunResult:
    """What a dry run has shown: ``text`` is the reason if it has not passed, or a summary.

    ``paths`` are the commanded positions by vehicle, for the scene.
    """

    passed: bool
    text: str
    duration: float = 0.0
    paths: tuple[tuple[str, tuple[Triple, ...]], ...] = ()


@dataclass(frozen=True)
class Series:
    """Numbers over time of one plot: ``times`` in s before now are negative, oldest first."""

    name: str
    unit: str
    times: tuple[float, ...]
    values: tuple[float, ...]


class Dashboard(ABC):
    """The graph, as pages see and command it."""

    pages: PageControl  #: Every page is opened and closed there; a method's ``page`` is its number.

    @abstractmethod
    def scene(self) -> Scene:
        """Return the newest scene, made 20 times a second while a page is open."""

    @abstractmethod
    def watch(self, page: int, vehicle: str | None) -> None:
        """Choose the vehicle whose plots a page shows."""

    @abstractmethod
    def plots(self, page: int) -> tuple[Series, ...]:
        """Return the last minute of the chosen vehicle and of the page's own fields."""

    @abstractmethod
    def add_field(self, page: int, path: str) -> "Future[None]":
        """Plot a number of any topic, as in /topic/field/other[0], too."""

    @abstractmethod
    def remove_field(self, page: int, path: str) -> None:
        """Plot it no longer."""

    @abstractmethod
    def command(self, page: int, command: Command) -> "Future[tuple[Outcome, ...]]":
        """Carry out a command; each vehicle has its outcome.

        An emergency may come from any page. For the others the page must have control.
        """

    @abstractmethod
    def parameter_owners(self) -> tuple[str, ...]:
        """Return nodes with live parameters, and vehicles with those of firmware."""

    @abstractmethod
    def parameters(self, owner: str | None = None) -> "Future[tuple[ParameterInfo, ...]]":
        """Return the live parameters of a node or of a vehicle's firmware; of all nodes.

        For many vehicles those of one owner are much quicker.
        """

    @abstractmethod
    def set_parameter(
        self, page: int, parameter: ParameterInfo, text: str
    ) -> "Future[ParameterInfo]":
        """Set a parameter to what was typed; the result has the value that came back."""

    @abstractmethod
    def mission_files(self) -> tuple[MissionFile, ...]:
        """Return what can be flown."""

    @abstractmethod
    def dry_run(
        self, page: int, mission: MissionFile, vehicles: tuple[str, ...]
    ) -> "Future[DryRunResult]":
        """Fly a mission with ideal vehicles that stand where the real ones are."""

    @abstractmethod
    def fly(
        self, page: int, mission: MissionFile, vehicles: tuple[str, ...], clicked: float
    ) -> "Future[str]":
        """Fly a mission after its dry run has passed; the future is done when it has ended."""

    @abstractmethod
    def stop_mission(self, page: int, clicked: float) -> "Future[None]":
        """End the mission that flies; its vehicles land."""

    @abstractmethod
    def examine(self) -> "Future[None]":
        """Have the doctor look the graph over: its sentences are in the scene, 10 s later."""

    @abstractmethod
    def watch_image(self, page: int, topic: str | None) -> "Future[None]":
        """Choose the camera that a page shows."""

    @abstractmethod
    def image(self, page: int) -> bytes | None:
        """Return the newest picture of the page's camera, as JPEG or PNG."""
