"""The interface of a swarm, behind the classes that Crazyswarm's scripts see.

`crazyflie_py.crazyflie` checks arguments. Commands are those of the vehicles of missions, see
`crazyflie_mission_api.mission_vehicle`; two swarms pass them on: `crazyflie_py.simulation` (--sim)
and `crazyflie_py.ros_swarm`. A swarm is the scripts' clock, too.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from crazyflie_mission_api.mission_vehicle import Setpoint
from crazyflie_model.angles import Triple
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_py.fleet import FleetVehicle

#: Colour in which Crazyswarm draws vehicles: red, green and blue, 0 to 1.
DEFAULT_COLOR = (0.5, 0.5, 1.0)

#: Keys of crazyswarm2's status that are fields of crazyflie_msgs/VehicleStatus; 0 with --sim.
STATUS_FIELDS = (
    "pm_state",
    "rssi",
    "latency_unicast",
    "num_rx_broadcast",
    "num_tx_broadcast",
    "num_rx_unicast",
    "num_tx_unicast",
)


class ScriptState(NamedTuple):
    """Position (m), velocity (m/s), acceleration (m/s^2) and roll, pitch, yaw (rad).

    In the world frame; ``R = Rz(yaw) Ry(pitch) Rx(roll)``, a positive pitch accelerates forward.
    """

    position: Triple
    velocity: Triple
    acceleration: Triple
    rpy: Triple


class Order(NamedTuple):
    """A command of a script, with the data that a swarm checks and records before it sends it."""

    name: str  #: Name of the method of a `MissionVehicle`, and of the service: "go_to".
    arguments: Sequence[Any] = ()  #: Arguments of the method before the mask.
    group_mask: int = 0
    flies: bool = False  #: Whether a flight may begin, which the end of the script has to end.
    #: Goal of the command, if it must be in the fence (m); NaN: unchanged.
    goal: Triple | None = None
    duration: float = -math.inf  #: Duration of its takeoff or landing (s).

    def send(self, commands: Any) -> Any:
        """Call the method of a `MissionVehicle` or of `Commands`; return its result."""
        groups = {"group_mask": self.group_mask} if self.group_mask else {}
        return getattr(commands, self.name)(*self.arguments, **groups)


class ParameterStore(Protocol):
    """Firmware parameters of a vehicle, "group.name" -> value."""

    def __getitem__(self, name: str) -> float:
        """Return a value; ValueError for an unknown name."""

    def update(self, values: Mapping[str, float]) -> None:
        """Set parameters; ValueError for unknown names."""


class NullVisualizer:
    """``timeHelper.visualizer``, with the methods that scripts call: draws nothing."""

    def setGraph(self, edges: Sequence[tuple[int, int]]) -> None:
        """Draw lines between vehicles from now on."""

    def showEllipsoids(self, radii: Sequence[float]) -> None:
        """Draw an ellipsoid with these radii (m) around each vehicle from now on."""

    def startVideoOutput(self, path: str, dt: float) -> None:
        """Write a video, a frame each ``dt`` (s)."""

    def finishVideoOutput(self) -> None:
        """End the video, if there is one."""

    def update(self, t: float, crazyflies: Sequence[Any]) -> None:
        """Draw vehicles at a time, s."""


class SwarmVehicle(Protocol):
    """A vehicle of a swarm."""

    name: str
    config: FleetVehicle
    groups: int  #: Mask of the groups that it belongs to.

    @property
    def parameters(self) -> ParameterStore:
        """Firmware parameters."""

    def send(self, setpoint: Setpoint) -> None:
        """Send a low-level setpoint once."""

    def set_group_mask(self, group_mask: int) -> Any:
        """Make the vehicle a member of groups, a bit each."""

    def checked_yaw(self, yaw: float) -> float:
        """Return a yaw that the vehicle can have, rad; another is refused."""

    def avoid(self, others: Sequence[Any], settings: AvoidanceSettings | None) -> None:
        """Avoid collisions with others of the swarm; None for settings ends that.

        With hardware the firmware determines the others.
        """

    def state(self) -> ScriptState:
        """Return the state; TimeoutError if none is received for 10 s."""

    def status(self) -> dict[str, Any]:
        """Return the status with the keys of crazyswarm2's Crazyflie.get_status."""


class TimeHelper(Protocol):
    """``timeHelper``, the clock: of the simulation with --sim, otherwise ROS's."""

    dt: float = 0.0  #: Period of the simulation's steps, s; 0 without --sim.
    visualizer: NullVisualizer  #: That of --sim; otherwise one that draws nothing.
    crazyflies: Sequence[Any] = ()  #: Those of `CrazyflieServer`.

    def time(self) -> float:
        """Return the time, s."""

    def sleep(self, duration: float) -> None:
        """Wait for a duration (s) of the vehicles' time."""

    def sleepForRate(self, rateHz: float) -> None:
        """Wait, so that the calls of a loop are 1/rateHz apart."""

    def isShutdown(self) -> bool:
        """Return whether the script should end, as after Ctrl-C."""
        return False

    def nextPhase(self) -> None:
        """Start the next file of --writecsv."""
        return


class Swarm(TimeHelper, Protocol):
    """All vehicles and the clock."""

    vehicles: Sequence[SwarmVehicle]  #: At least one vehicle; ids and names are different.

    def command(self, order: Order, vehicle: Any) -> None:
        """Send a command to a vehicle, or to all (None); returns when it is accepted."""

    def close(self) -> None:
        """Land and release the vehicles; called once at the end, also after an exception."""
