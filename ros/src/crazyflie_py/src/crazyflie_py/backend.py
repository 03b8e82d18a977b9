"""The interface of the back-ends of Crazyswarm's API.

`crazyflie_py.crazyflie` holds the classes that scripts see. They check arguments and call one of
two back-ends: `crazyflie_py.simulation` (--sim) and `crazyflie_py.ros_backend`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Protocol

from crazyflie_mission_api.mission_vehicle import HighLevelCommands
from crazyflie_model.angles import Triple
from crazyflie_model.collision_avoidance import AvoidanceSettings
from crazyflie_model.polynomials import PolynomialPiece
from crazyflie_py.setpoints import Setpoint

#: Colour in which Crazyswarm draws vehicles: red, green and blue, 0 to 1.
DEFAULT_COLOR = (0.5, 0.5, 1.0)


class VehicleState(NamedTuple):
    """Position (m), velocity (m/s), acceleration (m/s^2) and roll, pitch, yaw (rad).

    In the world frame; ``R = Rz(yaw) Ry(pitch) Rx(roll)``, a positive pitch accelerates forward.
    """

    position: Triple
    velocity: Triple
    acceleration: Triple
    rpy: Triple


class Commands(HighLevelCommands, Protocol):
    """Commands to a vehicle, or to all vehicles of a swarm at the same moment.

    Arguments are checked before. A command returns when it is sent, not when it is carried out.
    """

    def start_trajectory(
        self, trajectory_id: int, time_scale: float, reverse: bool, relative: bool, group_mask: int
    ) -> None:
        """Fly along an uploaded trajectory; ``relative``: from the planned position."""

    def notify_setpoints_stop(self, remain_valid_ms: int, group_mask: int) -> None:
        """Return to high-level commands when the last setpoint is this old (ms)."""

    def arm(self, arm: bool) -> None:
        """Arm or disarm."""

    def set_parameters(self, values: Mapping[str, float]) -> None:
        """Set firmware parameters, "group.name" -> value; ValueError for unknown names."""

    def send(self, setpoint: Setpoint) -> None:
        """Send a low-level setpoint once."""


class VehicleBackend(Commands, Protocol):
    """One vehicle."""

    name: str  #: "cf1".
    id: int  #: Last byte of the radio address.
    initial_position: Triple  #: Start point in the fleet file (m).

    def set_group_mask(self, group_mask: int) -> None:
        """Make the vehicle a member of groups, a bit each."""

    def upload_trajectory(
        self, trajectory_id: int, piece_offset: int, pieces: Sequence[PolynomialPiece]
    ) -> None:
        """Write pieces into the trajectory memory; returns when they are there."""

    def get_parameter(self, name: str) -> float:
        """Return a firmware parameter "group.name"; ValueError for an unknown name."""

    def enable_avoidance(
        self, others: Sequence["VehicleBackend"], settings: AvoidanceSettings
    ) -> None:
        """Avoid collisions; with hardware the firmware determines the others."""

    def disable_avoidance(self) -> None:
        """End collision avoidance."""

    def state(self) -> VehicleState:
        """Return the state; TimeoutError if none is received for 10 s."""

    def status(self) -> dict[str, Any]:
        """Return the status with the keys of crazyswarm2's Crazyflie.get_status."""


class Visualizer(Protocol):
    """Methods of ``timeHelper.visualizer`` that scripts call."""

    def setGraph(self, edges: Sequence[tuple[int, int]]) -> None:
        """Draw lines between vehicles, given by their numbers in ``crazyflies``."""

    def showEllipsoids(self, radii: Sequence[float]) -> None:
        """Draw an ellipsoid around each vehicle, radii in m."""

    def startVideoOutput(self, path: str, dt: float) -> None:
        """Write a video, a frame each ``dt`` (s)."""

    def finishVideoOutput(self) -> None:
        """End the video."""


class SwarmBackend(Commands, Protocol):
    """All vehicles and the clock.

    Commands are for all vehicles; `Commands.go_to` is relative then.
    """

    dt: float  #: Period of the clock's steps, s; of the real clock 0.

    @property
    def vehicles(self) -> Sequence[VehicleBackend]:
        """At least one; ids and names are different."""

    @property
    def visualizer(self) -> Visualizer:
        """The visualizer of --sim; otherwise one that draws nothing."""

    def time(self) -> float:
        """Return the time, s."""

    def sleep(self, duration: float) -> None:
        """Return after a duration (s) of the vehicles' time."""

    def sleep_for_rate(self, rate: float) -> None:
        """Sleep until 1/rate (s) after the return of the last call with this rate (Hz)."""

    def is_shutdown(self) -> bool:
        """Return whether the script should end."""

    def next_phase(self) -> None:
        """Begin the next file of a record, if there is one."""

    def close(self) -> None:
        """Land and release the vehicles; called once at the end, also after an exception."""


def _to_each(name: str) -> Any:
    """Return a method that calls that of each vehicle."""

    def command(self: SwarmBackend, *arguments: Any) -> None:
        for vehicle in self.vehicles:
            getattr(vehicle, name)(*arguments)

    return command


class EachVehicle:
    """`Commands` to all vehicles, one after the other."""

    take_off: Any = _to_each("take_off")
    land: Any = _to_each("land")
    stop: Any = _to_each("stop")
    go_to: Any = _to_each("go_to")
    start_trajectory: Any = _to_each("start_trajectory")
    notify_setpoints_stop: Any = _to_each("notify_setpoints_stop")
    emergency: Any = _to_each("emergency")
    arm: Any = _to_each("arm")
    set_parameters: Any = _to_each("set_parameters")
    send: Any = _to_each("send")
