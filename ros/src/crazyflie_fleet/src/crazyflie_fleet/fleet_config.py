"""Vehicles that fly together, their settings, and the types of these settings' values."""

import dataclasses
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from crazyflie_driver.positioning import MOCAP, SOURCES
from crazyflie_link.address import EXPECTED, Address
from crazyflie_link.errors import AddressError
from crazyflie_model.quadrotor import TYPES
from crazyflie_utils import Parameters, parameter
from crazyflie_utils.parameters.types import (
    BOOLEAN,
    FRAME,
    POSITION,
    TEXT,
    Converted,
    Integer,
    ListOf,
    Number,
    Text,
    matching,
)
from crazyflie_utils.parameters.vehicle_model import VEHICLE_MODEL

#: Help of settings that are read and only reported in a remark.
WITHOUT_EFFECT = "crazyswarm2's; has no effect here"
#: Tracking of a vehicle: by the motion capture system, or by the vehicle's only marker.
VENDOR, SINGLE_MARKER = "vendor", "single_marker"
#: Marker configurations with one marker.
_SINGLE_MARKERS = ("default_single_marker", SINGLE_MARKER)
LOCAL = "local"  #: Default machine of vehicles.
#: Connection of a vehicle, and of a body that has none.
CRAZYFLIE, NONE = "crazyflie", "none"

#: Key in ``default_topics`` -> standard topic of the driver; empty if there is no such topic.
DEFAULT_TOPICS = {
    "imu": "imu",
    "temperature": "temperature",
    "magnetic_field": "magnetic_field",
    "pressure": "pressure",
    "battery": "battery",
    "pose": "pose",
    "packets": "packets",
    "status": "battery",
    "odom": "",
    "scan": "",
}


#: Names below a vehicle's namespace that nodes of the workspace use: a topic of firmware variables
#: would have two types. A test compares them with the topics and services of these nodes.
RESERVED_NAMES = frozenset(
    """
    battery cmd_full_state cmd_hover cmd_position cmd_stop cmd_vel cmd_velocity_world connected
    control driver emergency emergency_reset external_pose external_position go_to heading
    high_level imu in_flight in_flight_filter_status
    in_flight_flight_status in_flight_hover_thrust in_flight_status land
    magnetic_field packets pose positioning pressure ref ref_descent ref_descent_safe ref_safe rssi
    state state_status status takeoff takeoff_inhibition temperature
    true_pose vehicle_status
    """.split()
)


#: Name of a vehicle's namespace and frame; /all/takeoff is a service for all vehicles.
VEHICLE_NAME = matching(
    "(?!all$)[A-Za-z][A-Za-z0-9_]*",
    "letters, digits and underscores, the first a letter, and not 'all'",
)


def address_of(uri: str) -> Address:
    """Return a vehicle's address; `ValueError` if it is malformed."""
    try:
        return Address.parse(uri.replace("radio://*/", "radio://0/"))
    except AddressError:
        raise ValueError from None


def _uri(value):
    address_of(TEXT(value))
    return value


#: A vehicle's address for `crazyflie_link`; crazyswarm2's ``*`` stands for any dongle.
_URI = Converted(_uri, EXPECTED)


def _start_position(value):
    x, y, z = POSITION(value)
    if z < 0.0:
        raise ValueError(f"z is {z:g}, below the ground")
    return x, y, z


#: Position of a vehicle before takeoff: x, y, z in m.
_START_POSITION = Converted(
    _start_position, f"{POSITION}, z at least 0", POSITION.label, POSITION.unit, "z >= 0"
)


#: Dynamics in simulation; on hardware they are the default type of vehicle.
DYNAMICS = ("near_hover", "coupled_7d", "quadrotor")


def _model(value):
    # A model file is read when its folder is known.
    is_known = value in DYNAMICS or TEXT(value).endswith((".yaml", ".yml"))
    return value if is_known else VEHICLE_MODEL(value)


_MODELS = (*DYNAMICS, *TYPES)
_MODEL = Converted(
    _model,
    f"one of {', '.join(_MODELS)}, or a model file",
    range=", ".join(f"`{name}`" for name in _MODELS) + ", or a file",
)


class LogTopicSettings(Parameters):
    """A topic of firmware variables."""

    frequency: float = parameter(Number("Hz", minimum=0.4, maximum=100.0), "rate of the messages")
    variables: tuple[str, ...] = parameter(
        ListOf(TEXT), "firmware variables, such as pm.vbat", name="vars"
    )


class DefaultTopicSettings(Parameters):
    """A standard topic; it comes at the driver's own rate."""

    frequency: float = parameter(Number("Hz", above=0.0), WITHOUT_EFFECT, 10.0)


class Settings(Parameters):
    """Settings in one place, of a vehicle, its type or ``all``; each overrides the next."""

    model: str = parameter(
        _MODEL,
        "dynamics in simulation; or a type of vehicle or a model file, relative to this file, for "
        "simulation (as a quadrotor), hardware and gains",
        "coupled_7d",
    )
    buffer: float = parameter(
        Number("m", above=0.0), "radius of the space that is reserved for the vehicle", 0.15
    )
    hover_height: float = parameter(
        Number("m", above=0.0), "where a takeoff ends, above the start point", 1.0
    )
    positioning: str = parameter(
        Text(SOURCES),
        "on hardware, source of the pose: motion capture, or the vehicle's own estimate by its "
        "Lighthouse, Flow or Loco deck",
        MOCAP,
    )
    lighthouse: str = parameter(
        Text(may_be_empty=True),
        "file with the geometry of base stations, as cfclient writes it, for the vehicle; relative "
        "to this file; empty for none",
        "",
    )
    machine: str = parameter(
        TEXT, "computer that flies it, of `machines`; `local` is always one of them", LOCAL
    )
    voltage_warning: float = parameter(
        Number("V", minimum=0.0),
        "below this voltage a warning is logged; takeoff is refused below it with `act`, "
        "otherwise below 3.2",
        3.2,
        "battery/voltage_warning",
    )
    voltage_critical: float = parameter(
        Number("V", minimum=0.0),
        "below this voltage a warning is logged; the vehicle is landed below it with `act`, "
        "otherwise below 3",
        3.0,
        "battery/voltage_critical",
    )
    voltages_act: bool = parameter(
        BOOLEAN, "the two voltages decide about takeoffs and landings", False, "battery/act"
    )
    mocap_enabled: bool = parameter(
        BOOLEAN,
        "`false` requires another `positioning` on hardware",
        True,
        "motion_capture/enabled",
    )
    own_mocap_frame: str | None = parameter(
        FRAME, "motion capture's frame; by default the vehicle's name", None, "motion_capture/frame"
    )
    mocap_tracking: str = parameter(
        Text((VENDOR, SINGLE_MARKER, "librigidbodytracker")),
        "on hardware: `vendor` is a rigid body of motion capture; `single_marker` one marker that "
        "is tracked by fleet_mocap_node, and so is `librigidbodytracker` with the marker "
        "`default_single_marker`, which is otherwise treated as `vendor`",
        VENDOR,
        "motion_capture/tracking",
    )
    mocap_marker: str = parameter(
        TEXT,
        "key in mocap_node's `marker_configurations`; see `motion_capture/tracking`",
        "default",
        "motion_capture/marker",
    )
    mocap_dynamics: str = parameter(
        TEXT,
        "a single marker's velocity limits: key in mocap_node's `dynamics_configurations`",
        "default",
        "motion_capture/dynamics",
    )
    big_quad: bool = parameter(BOOLEAN, WITHOUT_EFFECT, False)
    reference_frame: str = parameter(TEXT, WITHOUT_EFFECT, "world")
    enabled: bool = parameter(BOOLEAN, "whether the vehicle takes part", True)
    connection: str = parameter(
        Text((CRAZYFLIE, NONE)),
        "`none`: not a vehicle, but a body that motion capture sees; it is never flown, and "
        "vehicles keep apart from it",
        CRAZYFLIE,
    )
    uri: str | None = parameter(_URI, "address of the vehicle; not needed in simulation", None)
    id: int | None = parameter(
        Integer(0, 255),
        "number of the vehicle in scripts, and the last byte of its radio address if it has one",
        None,
    )
    position: tuple[float, float, float] | None = parameter(
        _START_POSITION, "position of the vehicle before takeoff", None, "initial_position"
    )
    type: str | None = parameter(TEXT, "of `robot_types`", None)

    @property
    def dynamics(self) -> str:
        """Dynamics in simulation, one of `DYNAMICS`."""
        return self.model if self.model in DYNAMICS else "quadrotor"

    @property
    def vehicle_model(self) -> str:
        """Type of the vehicle, or path of its model file."""
        return "cf21" if self.model in DYNAMICS else self.model

    @property
    def has_single_marker(self) -> bool:
        """Whether motion capture tracks the vehicle by its only marker."""
        if self.positioning != MOCAP:
            return False
        if self.mocap_tracking == "librigidbodytracker":
            return self.mocap_marker in _SINGLE_MARKERS
        return self.mocap_tracking == SINGLE_MARKER


class BroadcastSettings(Parameters):
    """Broadcasts of commands to all vehicles of a radio."""

    repeats: int = parameter(
        Integer(1, 100), "number of repetitions of each command", 5, "num_repeats"
    )
    period_ms: float = parameter(
        Number("ms", minimum=0.0, maximum=100.0),
        "time from one repetition to the next",
        1.0,
        "delay_between_repeats_ms",
    )


class MachineSettings(Parameters):
    """Another computer, with the attributes of roslaunch's tag ``machine``."""

    address: str = parameter(TEXT, "name or number in the network")
    env_loader: str = parameter(TEXT, "script there that sets ROS's environment")
    user: str | None = parameter(TEXT, "user for the login by ssh", None)


#: Vertical distance of two vehicles over their horizontal one: the downwash of the rotors reduces
#: the lift of a vehicle below.
DOWNWASH = 2.0

#: Parameter below a vehicle's name: its collision buffer, by which others plan (m).
BUFFER = "buffer"


class VehicleConfig(Settings):
    """One vehicle: its settings, merged from the vehicle, its type and ``all``."""

    position: tuple[float, float, float] = parameter(
        _START_POSITION, "position of the vehicle before takeoff", name="initial_position"
    )
    name: str = ""  # Its namespace and its tf frame.
    # Firmware parameters, "group.name" to value, written after each connection.
    firmware_params: Mapping[str, float] = dataclasses.field(default_factory=dict)
    default_topics: tuple[str, ...] = ("battery",)  # Standard topics that the driver publishes.
    # Topics of firmware variables, by their names below the vehicle's namespace.
    log_topics: Mapping[str, LogTopicSettings] = dataclasses.field(default_factory=dict)

    @property
    def hover_point(self) -> tuple[float, float, float]:
        """Position x, y, z at the end of a takeoff, m."""
        x, y, z = self.position
        return x, y, z + self.hover_height

    @property
    def mocap_frame(self) -> str:
        """Name of its tf frame from motion capture, or of its own estimate."""
        if self.positioning != MOCAP:
            return f"{self.name}/estimate"
        return self.own_mocap_frame or self.name

    @property
    def battery_limits(self) -> tuple[float, float]:
        """Voltages below which a takeoff is refused, and below which the vehicle is landed, V."""
        own = self if self.voltages_act else VehicleConfig
        return own.voltage_warning, own.voltage_critical


@dataclass(frozen=True)
class FleetConfig:
    """The vehicles that take part."""

    vehicles: tuple[VehicleConfig, ...]  # Enabled vehicles, in the order of the file.
    disabled: tuple[str, ...] = ()  # Names of the disabled ones.
    machines: Mapping[str, MachineSettings] = dataclasses.field(default_factory=dict)
    warnings: tuple[str, ...] = ()  # Remarks on the file: line and reason.
    # Parameters of the driver's broadcasts.
    broadcasts: Mapping[str, float] = dataclasses.field(default_factory=dict)
    # Pairs of names of vehicles whose start points are closer than their buffers.
    unplaced: tuple[tuple[str, str], ...] = ()
    # Bodies that are seen, and never flown: the entries with the connection `NONE`.
    obstacles: tuple[VehicleConfig, ...] = ()
    fence: bool = False  # Whether each vehicle has a geofence.

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the vehicles that take part."""
        return tuple(vehicle.name for vehicle in self.vehicles)

    def at_ports(self, first_port: int) -> "FleetConfig":
        """Return the same vehicles at UDP ports of this computer, one after the other."""
        uris = (f"udp://127.0.0.1:{port}" for port in itertools.count(first_port))
        return self._with_settings({"uri": uri} for uri in uris)

    def positioned_by(self, source: str) -> "FleetConfig":
        """Return the same vehicles with another source of their poses, of `SOURCES`."""
        return self._with_settings(itertools.repeat({"positioning": source}))

    def _with_settings(self, changes: Iterable[Mapping[str, Any]]) -> "FleetConfig":
        vehicles = tuple(
            dataclasses.replace(v, **change)
            for v, change in zip(self.vehicles, changes, strict=False)
        )
        return dataclasses.replace(self, vehicles=vehicles)

    def __getitem__(self, name: str) -> VehicleConfig:
        """Return a vehicle that takes part, or an obstacle; raises KeyError."""
        for vehicle in (*self.vehicles, *self.obstacles):
            if vehicle.name == name:
                return vehicle
        raise KeyError(name)


def close_pairs(
    positions: npt.NDArray[np.float64], buffers: Sequence[float] | npt.NDArray[np.float64]
) -> Iterator[tuple[int, int, float, float]]:
    """Yield the pairs of places that are closer than the buffers of their vehicles.

    Positions, shape (n, 3), and buffers (radii), shape (n,), are in m. A pair is i < j, its
    distance and the allowed one, m, with heights divided by `DOWNWASH`.
    """
    radii = np.asarray(buffers, dtype=float)
    if len(radii) < 2:
        return
    scaled = np.array(positions, dtype=float).reshape(-1, 3)
    scaled[:, 2] /= DOWNWASH
    pairs = cKDTree(scaled).query_pairs(2.0 * float(radii.max()), output_type="ndarray")
    distances = np.linalg.norm(scaled[pairs[:, 0]] - scaled[pairs[:, 1]], axis=1)
    allowed = radii[pairs[:, 0]] + radii[pairs[:, 1]]
    for (i, j), distance, limit in zip(pairs, distances, allowed, strict=True):
        if distance < limit:
            yield int(i), int(j), float(distance), float(limit)
