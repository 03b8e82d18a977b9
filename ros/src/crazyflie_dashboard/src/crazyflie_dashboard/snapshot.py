"""The vehicles and their surroundings at one moment, as plain data. Texts are never HTML.

Lengths are in m, angles in rad, times in s, in the fixed frame; None is "not known".
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from crazyflie_takeoff.envelope import Box

Triple = tuple[float, float, float]
Rotation = tuple[float, float, float, float]
T = TypeVar("T")

STALE_AGE = 0.5  #: A vehicle whose pose is older, s, is stale.


class Kind(Enum):
    """Kind of a vehicle."""

    SIMULATED = "simulated"
    VIRTUAL = "virtual"
    REAL = "real"


class Action(Enum):
    """Commands of a vehicle; the value is the text of a button."""

    TAKEOFF = "take off"
    LAND = "land"
    HOLD = "hold"
    GO_TO = "go to"
    EMERGENCY = "emergency"
    RESET = "reset"
    REBOOT = "reboot"
    ARM = "arm"
    DISARM = "disarm"
    RECOVER = "recover"
    IDENTIFY = "which one?"


class VehicleSnapshot(NamedTuple):
    """A vehicle. A tuple: two thousand are made in a second, four times as fast as a dataclass."""

    name: str  #: Its namespace without a slash in front, such as cf1; "/" without a namespace.
    kind: Kind = Kind.SIMULATED
    frame: str | None = None  #: Its frame on /tf.
    #: position, rotation: m, and a quaternion (x, y, z, w).
    position: Triple | None = None
    rotation: Rotation = (0.0, 0.0, 0.0, 1.0)
    velocity: Triple | None = None  #: m/s.
    pose_age: float | None = None  #: s.
    #: Whether the pose is older than `STALE_AGE`, or missing. Known for all vehicles if there are
    #: few, otherwise for watched ones.
    is_stale: bool = True
    reference: Triple | None = None  #: Desired position (m).
    control_age: float | None = None  #: s; as references.
    #: state, reason: State of the flight in words, and its reason; "" for an ordinary one.
    state: str = "not known"
    reason: str = ""
    takeoff_refusal: str = ""  #: Reason for which a takeoff would be refused.
    is_in_flight: bool = False
    is_emergency: bool = False
    is_held: bool = False  #: Whether a fleet holds it: it is too near to another vehicle.
    battery: float | None = None  #: V.
    is_battery_low: bool = False
    link_quality: float | None = None  #: 0 to 1.
    #: Hz, of pose, state, reference, control.
    rates: Mapping[str, float] = MappingProxyType({})
    actions: frozenset[Action] = frozenset()  #: Commands that it offers.


@dataclass(frozen=True, eq=False)
class Solids:
    """Walls, obstacles, points or lines of one kind, drawn together. Equal only to itself.

    ``rows`` has position (m), quaternion (x, y, z, w) and size along its own x, y, z (m) of each
    box, cylinder or ball, shape (n, 10); of points and ends of lines the position, shape (n, 3).
    ``colours`` are red, green and blue, 0 to 255, shape (n, 3); ``opacity`` is 0 to 1, and
    ``width`` (m) that of a point.
    """

    shape: str  #: "box", "cylinder", "ball", "points" or "lines".
    rows: NDArray[np.float32]
    colours: NDArray[np.uint8]
    opacity: float = 1.0
    width: float = 0.0


class Placed(NamedTuple, Generic[T]):
    """Something in a frame, with the frame's position (m) and quaternion (x, y, z, w)."""

    what: T
    position: Triple = (0.0, 0.0, 0.0)
    rotation: Rotation = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Sentence:
    """A problem and its remedy.

    ``level`` is "warn" or "error"; ``source`` is "doctor" or the name of a diagnostic.
    """

    level: str
    source: str
    text: str
    remedy: str = ""


@dataclass(frozen=True)
class LogLine:
    """A line of /rosout, or of a vehicle's console.

    ``level`` is "debug", "info", "warn", "error" or "fatal"; ``number`` rises by one from line to
    line; ``time`` is ROS time, s.
    """

    number: int
    time: float
    level: str
    node: str
    text: str


class Step(NamedTuple):
    """A command of a mission that flies, and how long it takes by the dry run (s)."""

    text: str
    duration: float
    state: str  #: "done", "now" or "next".


@dataclass(frozen=True)
class Scene:
    """Everything that a page shows at one moment."""

    #: Time at which it was made, by time.monotonic(); inf before the first one (s).
    made: float = math.inf
    fixed_frame: str = "world"
    #: By name, in the order in which they are shown.
    vehicles: Mapping[str, VehicleSnapshot] = field(default_factory=dict)
    solids: tuple[Placed[Solids], ...] = ()
    fences: tuple[Placed[Box], ...] = ()  #: Geofences.
    #: Names of frames of /tf that are not vehicles, such as rigid bodies of motion capture.
    frames: tuple[Placed[str], ...] = ()
    #: Planned trajectories, by the vehicle's name or by topic. Changes rarely.
    paths: Mapping[str, tuple[Triple, ...]] = field(default_factory=dict)
    sentences: tuple[Sentence, ...] = ()  #: Of the doctor and of /diagnostics, errors first.
    log: tuple[LogLine, ...] = ()  #: The newest ones, oldest first.
    images: tuple[str, ...] = ()  #: Topics of cameras.
    missions: tuple[str, ...] = ()  #: Running missions, as `Missions.running`.
    steps: tuple[Step, ...] = ()  #: Of the first of these missions, if its dry run has shown them.
    recording: str = ""  #: State of a recording that was begun here.
    recorded: str = ""  #: Its time and size.
