"""What pages ask for, and what they are answered, as plain data."""

from dataclasses import dataclass

from crazyflie_dashboard.snapshot import Action, Triple

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

    @property
    def words(self) -> str:
        """What is asked for, as a line of the log has it."""
        text = f"{self.action.value} {', '.join(self.vehicles)}"
        if self.action == Action.TAKEOFF:
            text += f" to {self.height:g} m"
        if self.goal is not None:
            text += f" to ({', '.join(f'{x:.2f}' for x in self.goal)}) m"
        return text


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
